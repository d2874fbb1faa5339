"""How the command blocks of the documents are run: in which order, and what a reader does between.

Every line is run as it stands, unless `WAYS` says what is added or why it is not run.
"""

from __future__ import annotations

from typing import Dict, List, NamedTuple

from document_blocks import Block, blocks

README, CONTRIBUTING = "README.md", "CONTRIBUTING.md"
CELL, RIG = "docs/tutorial_collab_cell.md", "docs/tutorials/own_rig.md"
DATASET = "docs/tutorials/calibrate_a_dataset.md"
PAGES = (README, CONTRIBUTING, CELL, DATASET, RIG)
CLONE, WORKSPACE, IN_USE = "a fresh clone", "a fresh workspace", "a master that was in use"


class Way(NamedTuple):
    """How a line is run where it is not run as it stands.

    Attributes:
        added: words behind it.
        stays: it ends at Ctrl-C only.
        code: the exit code that is due.
        not_run: why it is not run.
    """

    added: str = ""
    stays: bool = False
    code: int = 0
    not_run: str = ""


AS_IT_STANDS = Way()
# RViz by mouse and keys is `make test-rviz`; `tests/test_launches.py` opens it with each file.
NO_RVIZ = "rviz:=false"
_STAYS = Way(NO_RVIZ, stays=True)
_CALIBRATES = Way(f"{NO_RVIZ} stay:=false")

# By page: beginnings of lines.
WAYS: Dict[str, Dict[str, Way]] = {
    README: {
        "make test": Way(not_run="it is what runs the tests"),
        "roslaunch my_cell set_initial_estimate.launch": _STAYS,
        "roslaunch my_cell collect_data.launch": Way(
            f"automatic:=true loop:=false bag_rate:=0.5 {NO_RVIZ}"
        ),
        "roslaunch my_cell dataset_playback.launch": _STAYS,
        "roslaunch my_cell calibrate.launch": _CALIBRATES,
        "roslaunch collab_cell_description display.launch": _STAYS,
        "roslaunch atom_examples collab_cell_simulation.launch": _STAYS,
    },
    CONTRIBUTING: {
        "make test": Way(not_run="it is what runs the tests"),
    },
    CELL: {
        "roslaunch my_cell_calibration set_initial_estimate.launch": _STAYS,
        "roslaunch my_cell_calibration collect_data.launch": Way(NO_RVIZ),
        "roslaunch my_cell_calibration dataset_playback.launch": _STAYS,
        "roslaunch my_cell_calibration calibrate.launch": _CALIBRATES,
        "roslaunch my_cell_calibration playbag.launch": _STAYS,
        "roslaunch atom_calibration transform_corrector.launch": _STAYS,
    },
    DATASET: {
        "python3 -m atom_core check --dataset old/dataset.json": Way(code=2),
    },
    RIG: {
        "rosbag record": Way(not_run="the rig is a simulation: its recordings are made by that"),
    },
}


class Step(NamedTuple):
    """A block that is run in a setting."""

    block: Block
    folder: str  # in which it is typed, below the home


def steps(setting: str) -> List[Step]:
    """Return the blocks that are run in a setting, in order.

    Raises:
        KeyError: a page has no such block.
    """
    atom = "catkin_ws/src/atom" if setting == WORKSPACE else "atom"
    cell = [Step(block, atom) for block in blocks(CELL)]
    rig = [Step(block, atom) for block in blocks(RIG)]
    with_rviz = Step(block_of(README, "rosrun atom_calibration create_calibration_pkg"), atom)
    if setting == WORKSPACE:
        built = Step(block_of(CONTRIBUTING, "make -C src/atom setup"), "catkin_ws")
        return [built, *cell, with_rviz, *rig]
    if setting == IN_USE:
        return [*cell, with_rviz, *rig]
    of_readme = ("make demo", "source env.bash", "roslaunch collab_cell_description")
    return [
        Step(block_of(CONTRIBUTING, "make build"), atom),
        *[Step(block_of(README, begin), atom) for begin in of_readme],
        *[Step(block, atom) for block in blocks(DATASET)],
        *cell,
        with_rviz,
        *rig,
    ]


def block_of(page: str, begin: str) -> Block:
    """Return the block of a page whose first line begins so.

    Raises:
        KeyError: there is none.
    """
    for block in blocks(page):
        if block.lines[0].startswith(begin):
            return block
    raise KeyError(f"{page} has no block that begins with {begin!r}")


def way_of(page: str, line: str) -> Way:
    """Return how a line of a page is run."""
    return next((way for begin, way in WAYS[page].items() if line.startswith(begin)), AS_IT_STANDS)
