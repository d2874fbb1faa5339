"""What the tests of all packages share, and how they are spread over the processors."""

import gc
import os
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent


@pytest.hookimpl(hookwrapper=True)
def pytest_collection_modifyitems(items):
    """Take some of many variants, and begin with modules of many slow tests.

    `@pytest.mark.sampled(5)` leaves five of a test's variants to `make test`, evenly spaced, and
    the others to `make test-long`. `ATOM_TEST_VARIANTS=1` leaves one of every test's variants,
    where another interpreter is tried and not the law. A test of `make test-long` may say how long
    it is: `@pytest.mark.long(minutes=60)`. What takes long in a process must not come last.
    """
    _leave_out_variants(items, int(os.environ.get("ATOM_TEST_VARIANTS", 0)))
    yield  # now what is not run has been taken out
    slow = Counter()
    for item in items:
        mark = item.get_closest_marker("long") or item.get_closest_marker("slow")
        if mark:
            slow[item.path] += mark.kwargs.get("minutes", 1)
    items.sort(key=lambda item: -slow[item.path])


def _leave_out_variants(items, most):
    """Mark all variants of a test as long but as many as are wanted; `most` 0: of any test."""
    variants = {}
    for item in items:
        mark = item.get_closest_marker("sampled")
        if (mark or most) and not item.get_closest_marker("long"):
            count = min(mark.args[0], most or mark.args[0]) if mark else most
            variants.setdefault((item.nodeid.split("[")[0], count), []).append(item)
    for (_, count), alike in variants.items():
        last = len(alike) - 1
        kept = {round(i * last / max(count - 1, 1)) for i in range(count)}
        for place, item in enumerate(alike):
            if place not in kept:
                item.add_marker(pytest.mark.long)


def pytest_collection_finish():
    """Spare the garbage collector thousands of tests that live to the end: 3 % of the time."""
    gc.collect()
    gc.freeze()


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
