"""Where each number of the vector stands, what it is called, and in which unit it is."""

import numpy as np
import pytest

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import PATTERN, SENSOR, PoseBlock
from atom_core.problem.builder import build_problem
from atom_core.problem.camera_blocks import CameraBlock
from atom_core.problem.measurements import read_measurements
from atom_core.problem.parameters import Parameters
from atom_core.synthetic import arm, scenes

JOINTS = {"elbow": {"position_bias": 0.02}, "wrist_3": {"origin_y": 0.01, "origin_yaw": 0.01}}


def problem_of(dataset, **options):
    free = free_edges(dataset, CalibrationOptions(**options))
    measurements, _ = read_measurements(dataset)
    boards = initial_boards(dataset, measurements, free)
    return build_problem(dataset, measurements, boards, free)


@pytest.fixture(scope="module")
def with_all():
    """A problem with a sensor's pose, joints and intrinsics."""
    scene = arm.camera_on_arm(0, errors=JOINTS, collections=4)
    return problem_of(scene.dataset, intrinsics=("rgb_1",))


def test_every_number_has_its_name_and_unit(with_all):
    parameters = with_all.parameters
    named = {}
    for i in np.flatnonzero(parameters.free.ravel()):
        component = parameters.component(int(i))
        assert i in range(*parameters.slice_of(component.block).indices(parameters.size))
        assert i == parameters.columns(np.array(component.block))[component.place]
        named[component.name] = component.unit
    units = {"rgb_1 r2": "rad", "rgb_1 z": "m", "rgb_1 fx": "px", "rgb_1 k1": "1"}
    units.update({"joint elbow position_bias": "rad", "joint wrist_3 origin_y": "m"})
    assert {name: named[name] for name in units} == units
    assert len(named) == parameters.free_count


def test_intrinsics_stand_in_no_chain_and_the_rows_depend_on_them(with_all):
    parameters = with_all.parameters
    cameras = [i for i, block in enumerate(parameters.blocks) if isinstance(block, CameraBlock)]
    assert cameras and not np.isin(with_all.chains.block, cameras).any()
    assert np.isin(cameras, with_all.dependencies).all()
    assert np.flatnonzero(~parameters.is_transform).tolist() == cameras
    x = np.zeros(parameters.size)
    before = np.concatenate([r.ravel() for r in with_all.residuals(x)])
    x[parameters.slice_of(cameras[0])] = 1e-3
    after = np.concatenate([r.ravel() for r in with_all.residuals(x)])
    np.testing.assert_array_equal(with_all.poses(x), with_all.poses(np.zeros_like(x)))
    assert np.max(np.abs(after - before)) > 0.1


def test_the_rows_of_a_sensor_without_intrinsics_do_not_depend_on_any():
    problem = problem_of(scenes.random_scene(0, collections=4).dataset, intrinsics=("rgb_1",))
    for key, row in zip(problem.detections, problem.dependencies):
        seen = [problem.parameters.blocks[i] for i in row if i >= 0]
        assert any(isinstance(b, CameraBlock) for b in seen) == (key.sensor == "rgb_1")


def test_only_poses_take_new_initial_values(with_all):
    parameters = with_all.parameters
    pose = np.eye(4)
    pose[:3, 3] = [1.0, 2.0, 3.0]
    moved = parameters.with_initial({i: pose for i, _ in parameters.pose_blocks()})
    for i, _ in parameters.pose_blocks():
        np.testing.assert_array_equal(moved.poses(np.zeros(moved.size))[i], pose)
    for i, block in parameters.joint_blocks():
        assert moved.blocks[i] is block


def test_an_edge_stands_once_in_a_collection():
    edge, pose = Edge("a", "b"), np.eye(4)
    with pytest.raises(ValueError, match="two parameter blocks hold the same edge"):
        Parameters([PoseBlock(edge, SENSOR, None, ("s",), pose)] * 2)
    boards = [PoseBlock(edge, PATTERN, key, ("p",), pose) for key in ("001", "000")]
    parameters = Parameters(boards)
    assert [block.collection for block in parameters.blocks] == ["000", "001"]
    assert parameters.is_board_of_collection.all() and parameters.shared_count == 0
