"""What the tests of all packages share, and how they are spread over the processors."""

import contextlib
import fcntl
import os
import shutil
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


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """Return a function: a name and what fills a folder -> that folder, filled once in this run.

    With several processes (pytest-xdist) the first that asks fills it and the others wait.
    """
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def folder_of(name, fill):
        folder, done = shared / "made_once" / name, shared / "made_once" / f"{name}.done"
        folder.parent.mkdir(exist_ok=True)
        with locked(folder.with_suffix(".lock")):
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)  # of one who failed
                folder.mkdir()
                fill(folder)
                done.touch()
        return folder

    return folder_of


@contextlib.contextmanager
def locked(path):
    """Hold the lock of a file; whoever else wants it waits."""
    with open(path, "w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
