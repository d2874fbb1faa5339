"""The verdict: never good where a result is not; healthy rigs get no false alarm."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.model.caveats import Caveat
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge
from atom_core.report import verdict as limits
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.check_verdict import check_verdict
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.verdict import (
    GOOD,
    GRADES,
    WEAK,
    WRONG,
    Finding,
    Limits,
    is_named,
    sensor_verdict,
    verdict_document,
    verdict_lines,
    worst,
)
from atom_core.solvers.base import SolverOptions
from atom_core.synthetic import degenerate, mistakes, paper_cell, scenes
from atom_core.synthetic.board import charuco
from atom_core.synthetic.dataset import make_dataset
from atom_core.synthetic.driving import arm_between_boards
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Rig, Room
from atom_core.synthetic.scanners import cell_with_scanners

DOCUMENT = Path(__file__).parents[3] / "docs" / "certainty.md"
LONG_M = 0.05


def judged(dataset, **options):
    calibration = calibrate(dataset, CalibrationOptions(**options))
    return calibration, calibration_verdict(calibration_results(calibration, "any"))


@pytest.fixture(scope="module")
def cell():
    return paper_cell(0, disturbance=(0.1, 0.1))


@pytest.fixture(scope="module")
def calibrated(cell):
    return judged(cell.dataset)


@pytest.fixture(scope="module")
def test_cell():
    return paper_cell(0, "test")


# ---- a calibration


def test_a_healthy_cell_is_good_with_the_figures_of_each_sensor(cell, calibrated):
    calibration, verdict = calibrated
    assert calibration.status == "converged" and verdict.grade == GOOD
    assert list(verdict.sensors) == list(cell.dataset.sensors)
    for name, sensor in verdict.sensors.items():
        assert sensor.grade == GOOD and sensor.advice is None
        held = name == "rgb_3"
        assert ("held" in sensor.sentence) == held and ("known to" in sensor.sentence) != held
    assert "rgb_3" in verdict.sentence and "mm" in verdict.sentence


def test_what_has_not_converged_is_wrong_for_all_however_small_its_residuals(calibrated):
    started = calibrated[0].dataset  # from the solution, so that nothing else is wrong
    calibration, verdict = judged(started, solver=SolverOptions(max_iterations=1))
    assert calibration.status == "not_converged"
    assert {verdict.grade, *(s.grade for s in verdict.sensors.values())} == {WRONG}


@pytest.mark.parametrize("status", ["failed", "not_converged", "something new"])
def test_any_other_end_than_convergence_is_wrong(calibrated, status):
    ended = replace(calibrated[0], status=status, message="why")
    verdict = calibration_verdict(calibration_results(ended, "any"))
    assert verdict.grade == WRONG and "why" in verdict.sentence


def test_what_the_data_leave_open_is_weak_and_named():
    calibration, verdict = judged(degenerate.planar_motion().dataset)
    assert calibration.status == "rank_deficient" and verdict.grade == WEAK
    assert calibration.weak_directions[0].why in verdict.sentence
    assert {s.grade for s in verdict.sensors.values()} == {WEAK}
    assert all("open" in s.sentence and s.advice for s in verdict.sensors.values())


def exchanged(dataset, one, other):
    """Return the dataset with the labels of two sensors exchanged."""
    names = {one: other, other: one}
    return replace(
        dataset,
        collections={
            key: replace(
                c, labels={(names.get(s, s), p): label for (s, p), label in c.labels.items()}
            )
            for key, c in dataset.collections.items()
        },
    )


def test_what_is_contradicted_is_wrong_though_the_data_leave_something_open_too():
    data = exchanged(degenerate.planar_motion().dataset, "rgb_1", "rgb_2")
    calibration, verdict = judged(data)
    assert calibration.status == "rank_deficient" and verdict.grade == WRONG
    said = "sensors 'rgb_1' and 'rgb_2' each end where the description has the other"
    (contradiction,) = calibration.contradictions
    assert said in contradiction and said in calibration.message
    assert said in verdict.sentence and calibration.weak_directions[0].why in verdict.sentence
    assert {s.grade for s in verdict.sensors.values()} == {WRONG}
    assert judged(degenerate.planar_motion().dataset)[0].contradictions == ()


def test_a_camera_that_was_moved_is_called_that_where_the_data_leave_something_open_too():
    before = degenerate.planar_motion()
    arm = Edge("world", "robot_base")
    camera = before.dataset.sensors["rgb_2"].edge
    moved = se3.random_move(0.006, np.radians(0.3), np.random.default_rng(4))
    first = {**next(iter(before.dataset.collections.values())).transforms}
    rig = Rig(
        "world",
        before.dataset.sensors,
        {**first, camera: se3.moved(before.truth.edges[camera], moved)},
        {},
        None,
        Room((-7.0, -7.0, 0.0), (7.0, 7.0, 3.5)),
    )
    keys = list(before.dataset.collections)
    after = make_dataset(
        rig,
        {"pattern_1": [before.truth.boards["pattern_1", key] for key in keys]},
        Noise(),
        np.random.default_rng(9),
        patterns={"pattern_1": charuco(fixed=True)},
        motion=[{arm: before.dataset.collections[key].transforms[arm]} for key in keys],
    ).dataset
    late = {(key, "rgb_2"): mistakes.Origin(after, key) for key in keys[len(keys) // 2 :]}
    calibration, verdict = judged(mistakes.with_detections_from(before.dataset, late))
    assert calibration.status == "rank_deficient" and verdict.grade == WRONG
    assert "rgb_2 was moved between collections" in verdict.sentence
    assert "besides, the data do not determine all of it" in verdict.sentence
    assert verdict.sensors["rgb_2"].grade == WRONG and verdict.sensors["rgb_1"].grade == WEAK


def with_a_base_to_estimate(scene):
    """Return a camera on an arm whose base is off by 30 mm and to be estimated."""
    dataset, edge = scene.dataset, Edge("world", "rig_base")
    off = dataset.first_value(edge) @ se3.random_move(0.03, 0.015, np.random.default_rng(1))
    values = {
        edge: off,
        **{board_edge(dataset.patterns[n]): t for (n, _), t in scene.truth.boards.items()},
    }
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    config = replace(dataset.config, additional_tfs={"base": entry})
    return replace(dataset, config=config).with_transforms(
        dict.fromkeys(dataset.collections, values)
    )


def test_a_transform_that_is_known_well_is_good_and_one_that_a_prior_holds_as_well_as_that():
    data = with_a_base_to_estimate(scenes.hand_eye(0, collections=12))
    calibration, verdict = judged(data, anchor_patterns=True)
    assert calibration.status == "converged" and verdict.grade == GOOD, verdict.sentence
    assert "every estimated sensor and transform is known to" in verdict.sentence
    calibration, verdict = judged(data, priors={"base": (0.02, 0.01)})
    assert calibration.status == "converged" and verdict.grade == WEAK
    assert "'base' (world-rig_base) is known to 20 mm and 0.57 deg only" in verdict.sentence
    assert "prior" in verdict.sentence
    assert [sensor.grade for sensor in verdict.sensors.values()] == [GOOD]


def test_a_sensor_that_reads_long_is_wrong_and_told_from_the_others(cell):
    data = mistakes.with_long_ranges(cell.dataset, "lidar_2", LONG_M)
    calibration, verdict = judged(data)
    assert calibration.status == "inconsistent" and verdict.grade == WRONG
    accused = [name for name, s in verdict.sensors.items() if s.grade == WRONG]
    assert accused == ["lidar_2"]
    assert "reads" in verdict.sensors["lidar_2"].sentence
    assert "--range_offset lidar_2" in verdict.sensors["lidar_2"].advice
    assert {s.grade for n, s in verdict.sensors.items() if n not in accused} == {WEAK}


def test_few_boards_and_a_place_that_is_poorly_known_are_weak():
    verdict = judged(scenes.random_scene(0, collections=3).dataset)[1]
    assert verdict.grade == WEAK
    reason = next(iter(verdict.sensors.values())).sentence.partition("; ")[0]
    assert reason in verdict.sentence, "it stands alone where no lines are below it"
    for name, sensor in verdict.sensors.items():
        assert sensor.grade == WEAK and "too few boards" in sensor.sentence, name


def test_atoms_weights_are_no_standard_deviations_so_nothing_is_good(cell):
    options = SolverOptions(weights="atom", loss="none")
    calibration, verdict = judged(cell.dataset, solver=options)
    assert calibration.status == "converged" and verdict.grade == WEAK
    assert all("known to" not in s.sentence for s in verdict.sensors.values())


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 20))]
)
def test_healthy_cells_are_good_in_both_sets(seed):
    calibration, verdict = judged(paper_cell(seed, disturbance=(0.1, 0.1)).dataset)
    assert verdict.grade == GOOD, verdict_lines(verdict)
    seen = evaluation_verdict(evaluate(calibration.dataset, paper_cell(seed, "test").dataset))
    assert seen.grade == GOOD, verdict_lines(seen)


# ---- an evaluation


def test_a_calibration_holds_on_a_test_set_with_and_without_the_truth(calibrated, test_cell):
    train = calibrated[0].dataset
    for truth in (None, test_cell.truth):
        verdict = evaluation_verdict(evaluate(train, test_cell.dataset, truth=truth))
        assert verdict.grade == GOOD, verdict_lines(verdict)
        assert list(verdict.sensors) == list(train.sensors)
        told = {"from the truth" in s.sentence for s in verdict.sensors.values()}
        assert told == {truth is not None}


def test_a_file_that_was_not_calibrated_is_said_to_be_none(cell, test_cell):
    verdict = evaluation_verdict(evaluate(cell.dataset, test_cell.dataset))
    assert {verdict.grade, *(s.grade for s in verdict.sensors.values())} == {WRONG}
    assert "no calibration of these sensors" in verdict.sentence


def test_two_scans_in_one_plane_speak_for_neither():
    """Two cuts through a board are nearly in one plane in wrong calibrations, too."""
    scene = cell_with_scanners(0, disturbance=(0.1, 0.1))
    train = scene.dataset.selected(["rgb_1", "scanner_1", "scanner_2"])
    verdict = evaluation_verdict(evaluate(train, train))
    assert {verdict.grade, *(s.grade for s in verdict.sensors.values())} == {WRONG}
    assert "no calibration of these sensors" in verdict.sentence
    true = train.with_transforms(dict.fromkeys(train.collections, scene.truth.edges))
    verdict = evaluation_verdict(evaluate(true, train))
    assert {verdict.grade, *(s.grade for s in verdict.sensors.values())} == {GOOD}
    pushed_one = evaluation_verdict(evaluate(pushed(true, "scanner_1"), train))
    assert pushed_one.sensors["scanner_1"].grade == WRONG
    assert pushed_one.sensors["scanner_2"].grade == GOOD


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["lidar_1", "rgb_1", "depth_1"])
def test_one_sensor_that_was_pushed_is_blamed_alone(calibrated, test_cell, name):
    train = pushed(calibrated[0].dataset, name)
    verdict = evaluation_verdict(evaluate(train, test_cell.dataset))
    assert verdict.grade == WRONG and name in verdict.sentence
    assert [n for n, s in verdict.sensors.items() if s.grade != GOOD] == [name]
    assert verdict.sensors[name].advice


def pushed(dataset, name):
    """Return the dataset with one sensor 0.1 m and 0.1 rad from its place."""
    edge = dataset.sensors[name].edge
    move = se3.random_move(0.1, 0.1, np.random.default_rng(0))
    pose = dataset.first_value(edge) @ move
    return dataset.with_transforms({key: {edge: pose} for key in dataset.collections})


def test_a_sensor_among_others_that_are_wrong_is_not_good():
    scene = scenes.random_scene(3, rgb=2, depth=1, lidar3d=1, collections=8)
    train, moves = scene.dataset, np.random.default_rng(11)
    for sensor in train.sensors.values():
        pose = train.first_value(sensor.edge) @ se3.random_move(0.05, 0.05, moves)
        train = train.with_transforms({key: {sensor.edge: pose} for key in train.collections})
    verdict = evaluation_verdict(evaluate(train, scene.dataset))
    grades = {name: sensor.grade for name, sensor in verdict.sensors.items()}
    assert grades == {"rgb_1": WRONG, "rgb_2": WEAK, "depth_1": WEAK, "lidar_1": WEAK}
    assert "no sensor that is right here" in verdict.sensors["lidar_1"].sentence


def test_what_is_in_doubt_of_either_set_is_weak(test_cell):
    doubt = (Caveat(("lidar_1",), "two programs publish its mount", "record again"),)
    plain = test_cell.dataset
    doubtful = replace(plain, caveats=doubt)
    for train, test in ((plain, doubtful), (doubtful, plain)):
        verdict = evaluation_verdict(evaluate(train, test, sensors=["rgb_1", "rgb_2", "lidar_1"]))
        grades = {name: sensor.grade for name, sensor in verdict.sensors.items()}
        assert grades == {"rgb_1": GOOD, "rgb_2": GOOD, "lidar_1": WEAK}
        assert verdict.grade == WEAK
        assert "two programs publish" in verdict.sensors["lidar_1"].sentence


def test_where_nothing_depends_on_the_calibration_nothing_is_good():
    alone = scenes.random_scene(0, rgb=1, depth=0, lidar3d=0, collections=4).dataset
    verdict = evaluation_verdict(evaluate(alone, alone))
    assert verdict.grade == WEAK and "nothing was measured" in verdict.sentence


def test_a_camera_on_an_arm_agrees_with_nobody_and_disagrees_with_nobody():
    """It is told by what it is measured with: boards that stay."""
    scene = scenes.hand_eye(3, collections=6, disturbance=(0.1, 0.1))
    true = scene.dataset.with_transforms(
        dict.fromkeys(scene.dataset.collections, scene.truth.edges)
    )
    verdict = evaluation_verdict(evaluate(true, true))
    assert verdict.grade == GOOD and verdict.sentence.endswith("stay are found in one place")
    verdict = evaluation_verdict(evaluate(scene.dataset, scene.dataset))
    assert verdict.grade == WRONG
    assert re.search(
        r": boards that stay are up to \d+ mm apart and [0-9.]+ deg turned \(rgb_1\); ",
        verdict.sentence,
    )


def test_sensors_that_were_not_compared_are_not_said_to_agree():
    dataset = arm_between_boards(3).dataset
    verdict = evaluation_verdict(evaluate(dataset, dataset))
    assert verdict.grade == GOOD and verdict.sentence.endswith("no two sensors were compared")


# ---- a dataset before it is calibrated


def test_a_dataset_is_ready_or_the_sensor_in_the_way_is_named(cell):
    ready = check_verdict(cell.dataset, preflight(cell.dataset))
    assert ready.grade == GOOD and "ready" in ready.sentence
    apart = scenes.disconnected(0).dataset
    result = preflight(apart)
    verdict = check_verdict(apart, result)
    assert verdict.grade == WRONG and result.problems[0] in verdict.sentence
    few = scenes.random_scene(0, collections=3).dataset
    assert check_verdict(few, preflight(few)).grade == WEAK
    moved = check_verdict(cell.dataset, preflight(cell.dataset), {"rgb_1": "it stands elsewhere"})
    assert moved.sensors["rgb_1"].grade == moved.grade == WRONG


def test_what_is_in_doubt_is_weak_to_both_whatever_fits(calibrated, cell):
    doubt = (Caveat(("rgb_1",), "two programs publish its mount", "record again"),)
    dataset = replace(cell.dataset, caveats=doubt, warnings=tuple(c.sentence for c in doubt))
    calibration = calibrated[0]
    dubious = replace(calibration, dataset=replace(calibration.dataset, caveats=doubt))
    for verdict in (
        check_verdict(dataset, preflight(dataset)),
        calibration_verdict(calibration_results(dubious, "any")),
    ):
        grades = {name: sensor.grade for name, sensor in verdict.sensors.items()}
        assert grades.pop("rgb_1") == verdict.grade == WEAK and set(grades.values()) == {GOOD}
        assert "two programs publish its mount" in verdict.sentence
        assert verdict.sensors["rgb_1"].advice == "record again"


# ---- the parts


def test_the_worst_counts_and_what_is_no_number_is_wrong():
    assert worst([]) == GOOD and worst([GOOD, WRONG, WEAK]) == WRONG
    assert GRADES == (GOOD, WEAK, WRONG)
    assert [Limits(1.0, 2.0).grade(v) for v in (1.0, 1.5, 2.5, math.nan)] == [
        GOOD,
        WEAK,
        WRONG,
        WRONG,
    ]
    found = sensor_verdict([Finding(WEAK, "a"), Finding(WRONG, "b", "do")], "facts")
    assert (found.grade, found.sentence, found.advice) == (WRONG, "b; facts", "do")


def test_a_name_is_not_found_within_another_one():
    assert is_named("rgb_1", "sensor 'rgb_1': bad") and is_named("rgb_1", "rgb_1, rgb_2")
    assert not is_named("rgb_1", "rgb_11 and front/rgb_1 and rgb_1-link")


def test_lines_and_document_say_the_same(calibrated):
    verdict = calibrated[1]
    lines = verdict_lines(verdict).splitlines()
    assert lines[0].startswith("verdict: GOOD. ") and len(lines) == 1 + len(verdict.sensors)
    document = verdict_document(verdict)
    assert document["grade"] == GOOD and set(document["sensors"]) == set(verdict.sensors)
    for line, (name, sensor) in zip(lines[1:], document["sensors"].items()):
        assert line.split()[:2] == [name, GOOD] and line.endswith(sensor["sentence"])


def test_the_document_has_the_limits():
    """The table of docs/certainty.md, "The verdict", in the order of the constants."""
    text = DOCUMENT.read_text(encoding="utf-8")
    _, _, section = text.partition("\n## The verdict\n")
    rows = re.findall(r"^\| .*? \| `(\w+)`(?: `(\w+)`)? \| (.*?) \| (.*?) \|$", section, re.M)
    told = {(name, key): (good, wrong) for name, key, good, wrong in rows}
    for (name, key), shown in told.items():
        limit = getattr(limits, name)
        limit = limit[key] if key else limit
        assert shown == tuple(in_words(name, key, value) for value in limit), name
    constants = {n for n, v in vars(limits).items() if n.isupper() and isinstance(v, Limits)}
    assert constants | {"RESIDUAL"} == {name for name, _ in told}
    assert {key for name, key in told if name == "RESIDUAL"} == set(limits.RESIDUAL)


def in_words(name, key, value):
    if math.isinf(value):
        return "---"
    if name.endswith("_RAD"):
        return f"{math.degrees(value):g} deg"
    if name.endswith("_PX") or key == "reprojection":
        return f"{value:g} px"
    return f"{100 * value:g} %" if name.endswith("SHARE") else f"{1e3 * value:g} mm"
