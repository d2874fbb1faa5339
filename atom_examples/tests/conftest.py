"""Cells that several tests look at; built once, since each takes a second or two."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # cell_boards, which the tests share

from atom_examples.cell_simulator.world import World  # noqa: E402


@pytest.fixture(scope="session")
def world():
    """The cell of seed 0; tests move its board, so each puts it where it needs it."""
    cell = World(0)
    yield cell
    cell.scene.close()
