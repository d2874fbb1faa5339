"""What the tests of atom_core share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def real_data():
    """Return a function: name of a folder of real data -> its path; skips where it is absent."""
    repository = Path(__file__).resolve().parents[2]
    root = Path(os.environ.get("ATOM_TEST_DATA", repository.parent / "shared" / "data"))

    def folder(name):
        if not (root / name).is_dir():
            pytest.skip(f"no real data '{name}' in {root}; ATOM_TEST_DATA names another folder")
        return root / name

    return folder
