"""What the tests of atom_calibration share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # what tests and rostests share

from messages import Make  # noqa: E402


@pytest.fixture(scope="session")
def make():
    return Make
