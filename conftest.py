"""What the tests of all packages share, and how they are spread over the processors."""

import os
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent


def pytest_collection_modifyitems(items):
    """Begin with modules of many slow tests: what takes long in a process must not come last."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])


@pytest.fixture(scope="session")
def real_data():
    """Return a function: name of a folder of real data -> its path; skips where it is absent."""
    root = Path(os.environ.get("ATOM_TEST_DATA", ROOT.parent / "shared" / "data"))

    def folder(name):
        if not (root / name).is_dir():
            pytest.skip(f"no real data '{name}' in {root}; ATOM_TEST_DATA names another folder")
        return root / name

    return folder
