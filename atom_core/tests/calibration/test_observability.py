"""What data leave open is found, named and explained; what is healthy is let alone."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.reasons import Solution, is_spin_axis
from atom_core.calibration.options import CalibrationOptions
from atom_core.cli import main
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import pose
from atom_core.model.transforms import Edge
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import arm, degenerate, paper_cell, scenes

DISTURBED = (0.1, 0.1)
SEEDS = range(3)


def named(result):
    """Return every parameter that some weak direction names."""
    return {name for weak in result.weak_directions for name in weak.parameters}


def blocks_named(result):
    return {name.split()[0] for name in named(result)}


@pytest.mark.parametrize("solver_name", sorted(SOLVERS))
@pytest.mark.parametrize("seed", SEEDS)
def test_planar_motion_leaves_the_height_open(seed, solver_name):
    scene = degenerate.planar_motion(seed, disturbance=DISTURBED)
    result = calibrate(scene.dataset, CalibrationOptions(solver_name=solver_name))
    assert result.status == "rank_deficient"
    (weak,) = result.weak_directions
    assert set(weak.parameters) == {"rgb_1 z", "rgb_2 z", "pattern_1 z"}
    assert "along (0.00, 0.00, 1.00) of world together" in weak.why
    assert "turns about this axis only, as in planar motion" in weak.why


@pytest.mark.sampled(2)
@pytest.mark.parametrize("solver_name", sorted(SOLVERS))
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("one_plane", [False, True])
def test_parallel_boards_leave_shifts_along_them_and_the_turn_about_their_normal(
    one_plane, seed, solver_name
):
    scene = degenerate.parallel_boards(seed, one_plane=one_plane, disturbance=DISTURBED)
    result = calibrate(scene.dataset, CalibrationOptions(solver_name=solver_name))
    assert result.status == "rank_deficient"
    assert blocks_named(result) == {"lidar_1"}
    assert sorted(weak.unit for weak in result.weak_directions) == ["m", "m", "rad"]
    why = "lie in one plane" if one_plane else "are parallel"
    assert all(f"all boards that lidar_1 saw {why}" in w.why for w in result.weak_directions)
    normal = world_normal(scene)
    for weak in result.weak_directions:
        along = abs(axis_in(weak.why) @ normal)
        assert along > 0.99 if weak.unit == "rad" else along < 0.02


def world_normal(scene):
    """Return the boards' true normal in world."""
    return next(iter(scene.truth.boards.values()))[:3, 2]


def axis_in(why):
    return np.array([float(v) for v in why.split("(")[1].split(")")[0].split(",")])


def test_a_single_board_is_called_so():
    scene = degenerate.parallel_boards(0)
    keys = list(scene.dataset.collections)
    collections = {
        key: c
        if key == keys[0]
        else replace(c, labels={k: v for k, v in c.labels.items() if k[0] != "lidar_1"})
        for key, c in scene.dataset.collections.items()
    }
    result = calibrate(replace(scene.dataset, collections=collections))
    assert result.status == "rank_deficient"
    assert blocks_named(result) == {"lidar_1"}
    assert "lidar_1 saw the inside of a single board" in result.weak_directions[0].why


@pytest.mark.sampled(3)
@pytest.mark.parametrize("solver_name", sorted(SOLVERS))
@pytest.mark.parametrize("seed", SEEDS)
def test_of_two_edges_in_series_only_the_product_is_seen(seed, solver_name):
    scene = degenerate.redundant_edge(seed, disturbance=DISTURBED)
    result = calibrate(scene.dataset, CalibrationOptions(solver_name=solver_name))
    assert result.status == "rank_deficient"
    assert blocks_named(result) == {"post", "rgb_2"}
    assert len(result.weak_directions) == 6
    for weak in result.weak_directions:
        assert "'rig_base-rgb_2_post'" in weak.why and "'rgb_2_post-rgb_2_link'" in weak.why
        assert "only their product is seen" in weak.why


@pytest.mark.sampled(6)
@pytest.mark.parametrize("solver_name", sorted(SOLVERS))
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "which, blamed",
    [
        ("last", ("joint wrist_3 position_bias", "rgb_1 ")),
        ("first", ("joint shoulder_pan position_bias", "pattern_1 ")),
        ("own", ("joint elbow position_bias", "joint elbow origin_pitch")),
    ],
)
def test_a_redundant_joint_is_named_with_what_imitates_it(which, blamed, seed, solver_name):
    scene = degenerate.redundant_joint(seed, which=which, disturbance=DISTURBED)
    result = calibrate(scene.dataset, CalibrationOptions(solver_name=solver_name))
    assert result.status == "rank_deficient"
    (weak,) = result.weak_directions
    for name in blamed:
        assert any(parameter.startswith(name) for parameter in weak.parameters), weak
    assert all(parameter.startswith(blamed) for parameter in weak.parameters)
    assert "only both together are seen; estimate one of the two" in weak.why


def test_a_joint_that_nothing_seen_hangs_on_is_named():
    dataset = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.01}}).dataset
    collections = {
        key: replace(
            c,
            joints={**c.joints, "gripper": replace(c.joints["elbow"], edge=Edge("flange", "jaw"))},
        )
        for key, c in dataset.collections.items()
    }
    options = CalibrationOptions(joints={"gripper": ("position_bias",)})
    result = calibrate(replace(dataset, collections=collections), options)
    (weak,) = result.weak_directions
    assert weak.parameters == ("joint gripper position_bias",)
    assert "no sensor and no board that was seen hangs on joint gripper" in weak.why


def test_an_edge_above_sensor_and_free_board_is_followed_by_the_board():
    dataset = scenes.hand_eye(0, collections=12).dataset
    entry = EdgeConfig(parent_link="world", child_link="rig_base")
    config = replace(dataset.config, additional_tfs={"base": entry})
    result = calibrate(replace(dataset, config=config))
    assert result.status == "rank_deficient"
    assert blocks_named(result) == {"base", "pattern_1"}
    assert "only their product is seen" in result.weak_directions[0].why


def test_an_edge_that_carries_the_whole_rig_is_followed_by_the_boards():
    scene = scenes.two_cameras(0)
    edge = Edge("world", "rig_base")
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    config = replace(scene.dataset.config, additional_tfs={"base": entry})
    result = calibrate(replace(scene.dataset, config=config))
    assert result.status == "rank_deficient"
    assert blocks_named(result) == {"base"}
    assert "the boards' own poses are free: they follow" in result.weak_directions[0].why


@pytest.mark.parametrize("solver_name", sorted(SOLVERS))
@pytest.mark.parametrize("seed", SEEDS)
def test_an_unanchored_rig_is_held_by_its_first_sensor_and_the_user_is_told(seed, solver_name):
    scene = degenerate.unanchored(seed, disturbance=DISTURBED)
    result = calibrate(scene.dataset, CalibrationOptions(solver_name=solver_name))
    assert result.status == "converged" and result.weak_directions == ()
    assert any("sensor 'rgb_1' is held where it is" in w for w in result.warnings)
    edge = scene.dataset.sensors["rgb_1"].edge
    assert np.array_equal(scene.dataset.first_value(edge), result.dataset.first_value(edge))


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "scene, code",
    [
        (degenerate.planar_motion, 1),
        (degenerate.parallel_boards, 1),
        (degenerate.redundant_edge, 1),
        (degenerate.redundant_joint, 1),
        (degenerate.unanchored, 0),
    ],
)
def test_the_exit_code_tells(scene, code, tmp_path, capsys):
    path = write_dataset_folder(scene(0).dataset, tmp_path / "data", name="train")
    assert main(["calibrate", "-json", str(path), "--output", str(tmp_path / "out")]) == code
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert (document["status"] == "rank_deficient") == bool(code)
    assert bool(document["weak_directions"]) == bool(code)


def test_the_spin_axis_of_a_lidar_is_known():
    result = calibrate(degenerate.parallel_boards(0).dataset)
    solution = Solution(result.dataset, result.problem, result.summary.x)
    names = [block.names for block in result.problem.parameters.blocks]
    lidar, camera = names.index(("lidar_1",)), names.index(("rgb_2",))
    dataset = result.dataset
    first = next(iter(dataset.collections.values()))
    world_R_lidar = pose(first, dataset.graph, dataset.world, "lidar_1")[:3, :3]
    assert is_spin_axis(solution, lidar, world_R_lidar[:, 2])
    assert not is_spin_axis(solution, lidar, world_R_lidar[:, 0])
    assert not is_spin_axis(solution, camera, world_R_lidar[:, 2])


HEALTHY = [
    (paper_cell, {}),
    (scenes.random_scene, {}),
    (scenes.random_scene, {"rgb": 0, "depth": 2, "lidar3d": 1}),
    (scenes.lidar_only, {}),
    (scenes.shared_edge, {}),
    (scenes.two_patterns, {}),
    (scenes.two_cameras, {}),
    (scenes.two_cameras, {"collections": 4}),
    (scenes.hand_eye, {}),
    (scenes.board_on_arm, {}),
    (arm.camera_on_arm, {"collections": 14, "errors": {"elbow": {"position_bias": 0.02}}}),
    (arm.board_on_arm, {"collections": 14, "errors": {"wrist_1": {"position_bias": 0.02}}}),
]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("scene, options", HEALTHY)
def test_a_healthy_rig_raises_no_alarm(scene, options):
    result = calibrate(scene(7, disturbance=DISTURBED, **options).dataset)
    assert result.status == "converged", result.message
    assert result.weak_directions == ()
