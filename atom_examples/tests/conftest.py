"""Cells and plans that several tests look at; made once, since each takes seconds."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # cell_boards, which the tests share

from atom_examples.cell_simulator import recorder  # noqa: E402
from atom_examples.cell_simulator.planner import plan_stops  # noqa: E402
from atom_examples.cell_simulator.world import World  # noqa: E402


@pytest.fixture(scope="session")
def world():
    """The cell of seed 0; tests move its board, so each puts it where it needs it."""
    cell = World(0)
    yield cell
    cell.scene.close()


@pytest.fixture(scope="session")
def plans():
    """Return a function like `plan_stops` that remembers: a plan follows from its arguments."""
    known = {}

    def plan(world, scenario, collections):
        key = (world.seed, scenario, collections)
        if key not in known:
            known[key] = plan_stops(world, scenario, collections)
        return known[key]

    return plan


@pytest.fixture(scope="module")
def remembered_plans(plans):
    """Let recordings of this module take plans that were made before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "plan_stops", plans)
        yield
