"""Moving parts of which no joint is told: what is off in proportion to where they are."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import AUTO, CalibrationOptions
from atom_core.calibration.refine.joint_candidates import sizes_on_moving_parts
from atom_core.calibration.refine.moving_trends import moving_trends
from atom_core.calibration.refine.told_joints import told_joints
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.problem.model_errors import ShiftTrend
from atom_core.problem.moving_blocks import MovingPart
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.stated_errors import stated_errors
from atom_core.report.verdict import GOOD
from atom_core.synthetic import arm, scenes

MAKERS = {"camera": scenes.hand_eye, "board": scenes.board_on_arm}


def trends_in(found, of_all):
    told = told_joints(found.dataset, found.problem)
    return moving_trends(found.dataset, found.problem, told, of_all)


def moving_edge(dataset):
    """Return the edge of the arm's flange."""
    first, last = (dataset.collections[key].transforms for key in (*dataset.collections,)[:2])
    (edge,) = (edge for edge in first if not np.allclose(first[edge], last[edge], atol=1e-3))
    return edge


def told(dataset, change):
    """Return a dataset whose flange is told elsewhere: a function of its true pose."""
    edge = moving_edge(dataset)
    poses = {key: {edge: change(c.transforms[edge])} for key, c in dataset.collections.items()}
    return dataset.with_transforms(poses)


def scaled(*factors):
    def change(base_T_flange):
        return se3.transform(base_T_flange[:3, :3], base_T_flange[:3, 3] * factors)

    return change


def trends_of(scene):
    found = calibrate(scene.dataset, CalibrationOptions())
    return found, trends_in(found, True)


def test_a_trend_is_what_the_poses_change_by_as_the_part_moves_in_its_parent():
    """By central differences of the chain, in proportion to the coordinate."""
    found, trends = trends_of(scenes.hand_eye(0, collections=6))
    dataset, graph, edge = found.dataset, found.dataset.graph, moving_edge(found.dataset)
    assert len(trends) == 21 and not any(trend.is_named for trend in trends)
    places = np.array(
        [
            dataset.collections[k.collection].transforms[edge][:3, 3]
            for k in found.problem.detections
        ]
    )
    for trend in (t for t in trends if t.coordinate >= 3):
        place = places[:, trend.coordinate - 3]
        for d, key in enumerate(found.problem.detections):
            collection = dataset.collections[key.collection]
            parent_T_child = collection.transforms[edge]
            frames = dataset.sensors[key.sensor].frame, dataset.patterns[key.pattern].frame
            both = []
            for size in (1e-5, -1e-5):
                by = size * place[d] / np.std(place) * np.eye(3)[trend.axis]
                turned = se3.rotation_from_rotation_vector(np.zeros(3))
                shift = by
                if not isinstance(trend, ShiftTrend):
                    turned, shift = se3.rotation_from_rotation_vector(by), np.zeros(3)
                moved = parent_T_child.copy()
                moved[:3, :3], moved[:3, 3] = turned @ moved[:3, :3], moved[:3, 3] + shift
                now = replace(collection, transforms={**collection.transforms, edge: moved})
                both.append(pose(now, graph, *frames))
            off = both[0] @ se3.inverse(both[1])
            twist = np.append(se3.rotation_vector_from_rotation(off[:3, :3]), off[:3, 3]) / 2e-5
            np.testing.assert_allclose(trend.twists[d], twist, atol=1e-3)


def test_what_a_joint_is_told_of_has_none():
    found = calibrate(
        arm.camera_on_arm(0, errors={}, collections=4).dataset, CalibrationOptions(joints={})
    )
    assert trends_in(found, True) == []
    still = calibrate(scenes.two_cameras(0, collections=4).dataset, CalibrationOptions())
    assert trends_in(still, True) == []


def test_they_are_as_large_as_the_part_is_off_that_was_given_room():
    found, trends = trends_of(scenes.hand_eye(0, collections=6))
    part = {moving_edge(found.dataset): MovingPart(0.003, 0.002, {})}
    sizes = sizes_on_moving_parts({t: t.usual for t in trends}, found.dataset, part)
    for trend, size in sizes.items():
        assert size == (0.003 if isinstance(trend, ShiftTrend) else 0.002)


def test_a_part_that_is_taken_to_be_where_it_is_told_has_them_only_where_all_is_estimated():
    found, trends = trends_of(scenes.hand_eye(0, collections=6))
    assert trends and trends_in(found, False) == []
    options = CalibrationOptions(moving_edge_sigma={moving_edge(found.dataset).child: None})
    roomy = calibrate(scenes.hand_eye(0, collections=6).dataset, options)
    assert len(trends_in(roomy, False)) == len(trends)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "factors", [(1.01, 1.01, 1.01), (1.0, 1.0, 0.98), (0.99, 1.0, 1.0)], ids=str
)
def test_an_arm_whose_places_are_scaled_is_not_taken_for_a_good_one(make, seed, factors):
    """`auto` gave it room, or made the board larger: good, up to 55 combined sigmas off."""
    scene = MAKERS[make](seed, collections=16)
    dataset = told(scene.dataset, scaled(*factors))
    results = calibration_results(calibrate(dataset, CalibrationOptions(model_errors=AUTO)), "any")
    (error,) = stated_errors(results.edges, scene.truth)
    assert error.in_combined_sigmas < 3.0 or calibration_verdict(results).grade != GOOD


def test_auto_does_not_take_the_scale_of_an_arm_for_that_of_the_board():
    scene = scenes.board_on_arm(0, collections=18)
    dataset = told(scene.dataset, scaled(1.01, 1.01, 1.01))
    result = calibrate(dataset, CalibrationOptions(model_errors=AUTO))
    assert not any("board size" in warning for warning in result.warnings)
    assert result.status == "inconsistent" and "times what is usual" in result.message
