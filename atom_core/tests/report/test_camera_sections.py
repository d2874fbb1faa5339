"""A camera by itself is shown by the figures that were measured of it, on the page as in tables."""

import json
from dataclasses import replace

import pytest

from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.hand_eye_comparison import compare_hand_eye
from atom_core.report.evaluation_document import evaluation_document
from atom_core.report.evaluation_tables import evaluation_report, hand_eye_table
from atom_core.report.page.blocks import Folded, Table
from atom_core.report.page.evaluation_sections import pairs_section, truth_section
from atom_core.report.page.given import Given
from atom_core.report.tables import three_digits
from atom_core.synthetic.scenes import hand_eye, random_scene


@pytest.fixture(scope="module")
def scenes():
    return tuple(hand_eye(3, collections=6, disturbance=(off, off)) for off in (0.0, 0.01))


@pytest.fixture(scope="module")
def results(scenes):
    """An evaluation at the true edges, and one of a calibration that is off by 10 mm."""
    right, off = scenes
    truth = right.truth
    return tuple(evaluate(one.dataset, right.dataset, truth=truth) for one in (right, off))


def page_of(evaluation, *more):
    document = json.loads(json.dumps(evaluation_document(evaluation, *more)))
    return document, Given(None, document)


def tables(section):
    return {block.caption: block for block in section.blocks if isinstance(block, Table)}


def test_a_camera_on_an_arm_has_its_reprojection_and_spread_beside_those_of_another_calibration(
    results,
):
    measured, other = results
    _, given = page_of(measured, other)
    (section,) = pairs_section(given)
    found = tables(section)
    assert "Averages by kind of pair" not in found  # there is no pair
    ((*names, mean, rms, floor, beside),) = found["Cameras by themselves"].rows
    (single,), (single_of_other,) = measured.single, other.single
    assert names[:3] == ["rgb_1", "pattern_1", "one pose for all"]
    assert rms == three_digits(single.measured.rms) == floor
    assert beside == three_digits(single_of_other.measured.rms) and float(beside) > 3 * float(rms)
    screen = evaluation_report(measured, other)
    assert all(text in screen for text in (mean, rms, beside))
    (spread,) = found["Spread of fixed boards, from one collection to another"].rows
    (apart,), (apart_of_other,) = measured.spread, other.spread
    assert spread[:2] == ["rgb_1", str(len(apart.measured.per_collection))]
    assert spread[4] == spread[7] == three_digits(apart.measured.translation_mm)
    assert spread[9] == three_digits(apart_of_other.measured.translation_mm)
    assert float(spread[9]) > 5.0 and spread[9] in screen


def test_hand_eye_methods_have_a_line_each(scenes, results):
    right, _ = scenes
    compared = compare_hand_eye(right.dataset, right.dataset, results[0], truth=right.truth)
    _, given = page_of(results[0], None, compared)
    (section,) = pairs_section(given)
    rows = tables(section)["Hand-eye methods on the same labels"].rows
    assert [row[0] for row in rows][:2] == ["this calibration", "OpenCV tsai"]
    lines = hand_eye_table(compared).splitlines()[3:]
    for row, line in zip(rows, lines):
        assert line.split()[-6:] == [str(cell) for cell in row[2:]]


def test_why_a_spread_is_not_measured_stands_beside_the_pairs():
    scene = random_scene(1, rgb=1, depth=0, lidar3d=0, collections=3)
    board = replace(scene.dataset.patterns["pattern_1"], fixed=True)
    dataset = replace(scene.dataset, patterns={"pattern_1": board})
    _, given = page_of(evaluate(dataset, dataset))
    (section,) = pairs_section(given)
    (folded,) = [block for block in section.blocks if isinstance(block, Folded)]
    ((*_, why),) = folded.blocks[0].rows
    assert "neither 'rgb_1' nor the board moves" in why


def test_errors_against_the_truth_stand_beside_those_of_another_calibration(results):
    _, given = page_of(*results)
    (section,) = truth_section(given)
    (table,) = section.blocks
    assert list(table.columns)[-1] == "compared with"
    name, *_, beside = table.rows[1]
    assert name == "rgb_1" and float(beside.split(",")[0]) == pytest.approx(10.0, abs=0.1)
