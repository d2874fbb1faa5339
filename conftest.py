"""What the tests of all packages share, and how they are spread over the processors."""

import os
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent


@pytest.hookimpl(trylast=True)  # what is not run does not count
def pytest_collection_modifyitems(items):
    """Begin with modules of many slow tests: what takes long in a process must not come last.

    A test of `make test-long` may say how long it is: `@pytest.mark.long(minutes=60)`.
    """
    slow = Counter()
    for item in items:
        mark = item.get_closest_marker("long") or item.get_closest_marker("slow")
        if mark:
            slow[item.path] += mark.kwargs.get("minutes", 1)
    items.sort(key=lambda item: -slow[item.path])


_LEFT_OUT = "atom_core.commands.report_option.LEFT_OUT"


@pytest.fixture(scope="session", autouse=True)
def reports_left_out():
    """Let commands write no reports, also for what tests share: drawing takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_LEFT_OUT, True)
        yield


@pytest.fixture(autouse=True)
def reports_where_they_are_looked_at(request, monkeypatch):
    """Let commands write reports in tests with the mark `report`."""
    if request.node.get_closest_marker("report"):
        monkeypatch.setattr(_LEFT_OUT, False)


@pytest.fixture(scope="session")
def real_data():
    """Return a function: name of a folder of real data -> its path; skips where it is absent."""
    root = Path(os.environ.get("ATOM_TEST_DATA", ROOT.parent / "shared" / "data"))

    def folder(name):
        if not (root / name).is_dir():
            pytest.skip(f"no real data '{name}' in {root}; ATOM_TEST_DATA names another folder")
        return root / name

    return folder
