"""What the tests of atom_calibration share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # what tests and rostests share

from messages import Make  # noqa: E402
from stand_in_rig import Place, use_stand_ins  # noqa: E402


@pytest.fixture(scope="session")
def make():
    return Make


@pytest.fixture
def place(make, tmp_path, monkeypatch):
    """Return a function: messages -> arguments of collect_from_bag, which stand-ins label for."""
    use_stand_ins(monkeypatch)
    return Place(make, tmp_path)
