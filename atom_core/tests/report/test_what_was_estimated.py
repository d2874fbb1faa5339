"""All that a calibration estimated is in its report, said as on the screen."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.model.dataset import MULTIPLE
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_tables import calibration_report
from atom_core.report.page.blocks import Table, Text, Tree
from atom_core.report.page.calibration_sections import certainty_section
from atom_core.report.page.given import Given
from atom_core.report.page.moves import moves_section
from atom_core.report.tables import ABSENT
from atom_core.synthetic.driving import ODOMETRY, vehicle_before_a_board
from atom_core.synthetic.scenes import random_scene


def given_of(calibration):
    document = calibration_document(calibration_results(calibration, "test"), {})
    return Given(json.loads(json.dumps(document)), None, calibration.dataset)


def words(section):
    return [block.text for block in section.blocks if isinstance(block, Text)]


def branches(nodes):
    return [one for node in nodes for one in (node, *branches(node.children))]


def test_odometry_has_a_name_and_no_way_that_only_its_first_pose_went():
    scene = vehicle_before_a_board(3, odometry=True, off=0.02)
    dataset = replace(scene.dataset, edge_types={ODOMETRY: MULTIPLE})
    calibration = calibrate(dataset)
    given = given_of(calibration)
    (section,) = moves_section(given)
    rows = {row[1]: row for row in section.blocks[0].rows}
    assert rows["world-base"][:5] == ["world-base"] * 2 + ["a value for each collection"] + [
        ABSENT,
        ABSENT,
    ]
    assert "known worst" in section.blocks[0].note
    (tree,) = [block for block in section.blocks if isinstance(block, Tree)]
    notes = [node.note for node in branches(tree.roots) if node.note]
    assert "world-base: a value for each collection" in notes
    screen = calibration_report(calibration_results(calibration, "test")).splitlines()
    (line,) = [line for line in screen if line.startswith("world-base (sigma:")]
    assert line.split(")")[1].split()[:2] == [ABSENT, ABSENT]
    for key, collection in given.before.collections.items():  # it is where it was found to be
        found = calibration.dataset.collections[key].transforms[ODOMETRY]
        assert np.array_equal(collection.transforms[ODOMETRY], found)


@pytest.fixture(scope="module")
def freed():
    """A calibration that estimated intrinsics and what a LiDAR reads long."""
    scene = random_scene(4, rgb=2, depth=0, lidar3d=1, collections=10, disturbance=(0.02, 0.02))
    options = CalibrationOptions(intrinsics=("rgb_2",), range_offset=("lidar_1",))
    return calibrate(scene.dataset, options)


def test_intrinsics_and_errors_that_were_estimated_stand_beside_what_moved(freed):
    results, given = calibration_results(freed, "test"), given_of(freed)
    (section,) = moves_section(given)
    tables = {block.caption: block for block in section.blocks if isinstance(block, Table)}
    rows = {row[1]: row for row in tables["Intrinsics that were estimated"].rows}
    by_name = {p.name: p for p in results.sensors["rgb_2"].intrinsics}
    assert set(rows) == set(by_name)
    for name, p in by_name.items():
        digits = 3 if p.unit == "px" else 6
        wanted = [f"{v:.{digits}f}" for v in (p.value, p.change, p.combined_sigma)]
        assert rows[name][2:5] == wanted
    (told,) = [text for text in words(section) if text.startswith("Estimated: lidar_1 reads")]
    assert told[:1].lower() + told[1:-1] in calibration_report(results)


def test_what_the_data_show_has_its_rivals_or_its_remedy(freed):
    given = given_of(freed)
    error = {**given.calibration["model_errors"][0], "estimated": False}
    alone = {**error, "sentence": "lift reads 3 mm long", "option": ""}
    rival = {**error, "sentence": "board is 1 % larger", "rivals": ["range scale of lidar_1"]}
    document = {**given.calibration, "model_errors": [error, alone, rival]}
    (section,) = certainty_section(Given(document, None))
    told = [text for text in words(section) if text.startswith("The data show: ")]
    assert told[0].endswith("(--range_offset lidar_1 estimates it)")
    assert "lift reads 3 mm long (no option estimates it: " in told[1]
    assert told[2].endswith("these boards cannot tell it from: range scale of lidar_1")
