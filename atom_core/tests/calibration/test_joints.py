"""Joints whose description is wrong: found within their sigmas, and written for others to read."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.joints import select_joints
from atom_core.cli import main
from atom_core.errors import CalibrationError, SelectionError
from atom_core.evaluation.ground_truth import ground_truth_errors
from atom_core.evaluation.mixed import mixed_dataset
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.urdf import read_description
from atom_core.model.config import JointConfig
from atom_core.model.dataset import pose
from atom_core.model.joints import JOINT_PARAMETERS, JointState, joint_from_pose
from atom_core.model.transforms import Edge
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import Noise, arm

ERRORS = {
    "shoulder_lift": {"origin_x": 0.01, "position_bias": 0.02},
    "telescope": {"position_bias": 0.008},
    "elbow": {"position_bias": -0.03},
    "wrist_2": {"origin_z": 0.004, "origin_yaw": 0.01},
}
DISTURBED = (0.1, 0.1)
MAKERS = {"camera": arm.camera_on_arm, "board": arm.board_on_arm}


def found_and_planted(scene, result):
    """Return (n,) found values minus true ones, and their sigmas."""
    errors, sigmas = [], []
    for i, block in result.problem.parameters.joint_blocks():
        name, variance = block.joint, np.diagonal(result.covariance.block(i))
        for place, parameter in block.free_components:
            truth = scene.dataset.joint(name).parameters[parameter] + ERRORS[name][parameter]
            errors.append(result.dataset.joint(name).parameters[parameter] - truth)
            sigmas.append(np.sqrt(variance[place]))
    return np.array(errors), np.array(sigmas)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("make", MAKERS)
def test_planted_errors_are_found_within_their_sigmas(make):
    normalised = []
    for seed in range(8):
        scene = MAKERS[make](seed, errors=ERRORS, collections=20, disturbance=DISTURBED)
        result = calibrate(scene.dataset)
        assert result.status == "converged", result.message
        errors, sigmas = found_and_planted(scene, result)
        assert np.all(sigmas < 2e-3)
        normalised.append(errors / sigmas)
        assert ground_truth_errors(result.dataset, scene.truth) is not None
    pooled = np.array(normalised)
    assert np.max(np.abs(pooled)) < 4.0
    assert 0.75 < np.sqrt(np.mean(pooled**2)) < 1.3


@pytest.mark.parametrize("make", MAKERS)
def test_exact_measurements_give_the_exact_joints(make):
    scene = MAKERS[make](3, errors=ERRORS, collections=15, noise=Noise.none())
    result = calibrate(scene.dataset, CalibrationOptions(initial_guess="none"))
    errors, _ = found_and_planted(scene, result)
    assert np.max(np.abs(errors)) < 1e-7


@pytest.mark.parametrize("make", MAKERS)
def test_both_solvers_agree(make):
    scene, found = MAKERS[make](1, errors=ERRORS, collections=15, disturbance=DISTURBED), []
    for name in sorted(SOLVERS):
        result = calibrate(scene.dataset, CalibrationOptions(solver_name=name))
        values = [result.dataset.joint(j).parameters[p] for j in ERRORS for p in ERRORS[j]]
        found.append([*values, *result.dataset.first_value(Edge(*edge_of(scene)))[:3].ravel()])
    np.testing.assert_allclose(found[0], found[-1], atol=1e-6)


def edge_of(scene):
    return scene.dataset.sensors["rgb_1"].edge


def test_what_is_not_asked_for_stays():
    scene = arm.camera_on_arm(0, errors=ERRORS, collections=12)
    options = CalibrationOptions(joints={"elbow": ("position_bias",)})
    solved = calibrate(scene.dataset, options).dataset
    for name in arm.JOINT_NAMES:
        for parameter, value in scene.dataset.joint(name).parameters.items():
            changed = solved.joint(name).parameters[parameter] != value
            assert changed == ((name, parameter) == ("elbow", "position_bias"))
    held = calibrate(scene.dataset, CalibrationOptions(joints={}))
    for key, collection in held.dataset.collections.items():
        for joint in collection.joints.values():
            before = scene.dataset.collections[key].transforms[joint.edge]
            np.testing.assert_array_equal(collection.transforms[joint.edge], before)


def test_transforms_of_the_solution_are_those_of_its_joints():
    solved = calibrate(arm.board_on_arm(2, errors=ERRORS, collections=12).dataset).dataset
    for collection in solved.collections.values():
        for joint in collection.joints.values():
            np.testing.assert_allclose(collection.transforms[joint.edge], joint.parent_T_child)


def test_transforms_that_contradict_the_positions_are_told():
    dataset = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.01}}).dataset
    edge = dataset.joint("elbow").edge
    turned = dataset.first_value(edge) @ se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, 0.1]))
    wrong = dataset.with_transforms({key: {edge: turned} for key in ["003"]})
    result = calibrate(wrong)
    assert any("joint 'elbow': the transforms" in w for w in result.warnings)
    right = calibrate(dataset)
    assert not any("joint 'elbow'" in w for w in right.warnings)
    np.testing.assert_allclose(result.summary.x, right.summary.x, atol=1e-9)


# ---------------------------------------------------------------------------- selections


def test_selections_take_names_globs_and_lambdas():
    dataset = arm.camera_on_arm(0, errors=ERRORS, collections=3).dataset
    assert select_joints(dataset, ["elbow"], []) == {"elbow": ("position_bias",)}
    assert select_joints(dataset, ["sh*"], ["*bias"]) == {"shoulder_lift": ("position_bias",)}
    chosen = select_joints(dataset, ["lambda n: n.startswith('wrist_2')"], [])
    assert chosen == {"wrist_2": ("origin_z", "origin_yaw")}
    assert set(select_joints(dataset, [], ["position_bias"])) == set(ERRORS) - {"wrist_2"}
    assert select_joints(dataset, ["wrist_1"], ["origin_x"]) == {"wrist_1": ("origin_x",)}


@pytest.mark.parametrize(
    "joints, parameters, error, message",
    [
        (["hip"], [], SelectionError, "no joint matches 'hip'"),
        (["elbow"], ["origin_w"], SelectionError, "no joint parameter matches 'origin_w'"),
        (["elbow"], ["origin_x"], CalibrationError, "'elbow' has none of the selected parameters"),
        (["wrist_1"], [], CalibrationError, "the configuration names no parameters of it"),
        ([], ["origin_roll"], CalibrationError, "no joint has the selected parameters"),
    ],
)
def test_selections_that_leave_nothing_are_refused(joints, parameters, error, message):
    dataset = arm.camera_on_arm(0, errors=ERRORS, collections=3).dataset
    with pytest.raises(error, match=message):
        select_joints(dataset, joints, parameters)


@pytest.mark.parametrize(
    "joints, parameters",
    [
        (["lambda j: False"], []),
        ([], ["lambda p: p == 'origin_roll'"]),
        (["lambda j: True"], ["lambda p: False"]),
        (["!*"], []),
    ],
)
def test_conditions_that_hold_for_no_joint_calibrate_none(joints, parameters):
    dataset = arm.camera_on_arm(0, errors=ERRORS, collections=3).dataset
    assert select_joints(dataset, joints, parameters) == {}


def test_a_condition_is_about_joints_that_are_configured():
    dataset = arm.camera_on_arm(0, errors=ERRORS, collections=3).dataset
    bare = replace(dataset, config=replace(dataset.config, joints={}))
    assert select_joints(bare, ["lambda j: True"], []) == {}
    assert select_joints(without_joints(bare, bare.collections), ["lambda j: True"], []) == {}
    chosen = select_joints(dataset, ["lambda j: True"], ["lambda p: 'bias' in p"])
    assert set(chosen) == set(ERRORS) - {"wrist_2"}


def without_joints(dataset, keys):
    collections = {
        key: replace(c, joints={}) if key in keys else c for key, c in dataset.collections.items()
    }
    return replace(dataset, collections=collections)


def test_joints_that_cannot_be_calibrated_are_refused():
    dataset = arm.camera_on_arm(0, errors=ERRORS, collections=4).dataset
    with pytest.raises(CalibrationError, match="no collection has its position.*--hold_joints"):
        calibrate(without_joints(dataset, dataset.collections))
    with pytest.raises(CalibrationError, match="absent from collection 001, 002"):
        calibrate(without_joints(dataset, ["001", "002"]))
    with pytest.raises(CalibrationError, match="'speed' is unknown"):
        calibrate(dataset, CalibrationOptions(joints={"elbow": ("speed",)}))
    bare = replace(dataset, config=replace(dataset.config, joints={}))
    with pytest.raises(CalibrationError, match="there are no joints to select"):
        select_joints(without_joints(bare, dataset.collections), ["elbow"], [])
    c = dataset.collections["002"]
    other = c.joints["elbow"].with_parameters({"origin_x": 0.1})
    mixed = replace(c, joints={**c.joints, "elbow": other})
    with pytest.raises(CalibrationError, match="differ between collections"):
        calibrate(replace(dataset, collections={**dataset.collections, "002": mixed}))
    flange = dataset.joint("wrist_3")
    sensor = replace(dataset.sensors["rgb_1"], edge=flange.edge)
    options = CalibrationOptions(joints={"wrist_3": ("origin_x",)})
    with pytest.raises(CalibrationError, match="estimated already, of sensor 'rgb_1'"):
        calibrate(replace(dataset, sensors={"rgb_1": sensor}), options)


# --------------------------------------------------------------------------------- files


def urdf_of(dataset):
    """Return a description of the arm as the dataset has it, the camera's link on its flange."""
    first = next(iter(dataset.collections.values()))
    joints = [(name, j.type, j.edge, j.origin, j.axis) for name, j in first.joints.items()] + [
        (f"{edge.child}_joint", "fixed", edge, matrix, (1, 0, 0))
        for edge, matrix in first.transforms.items()
        if edge not in [j.edge for j in first.joints.values()] and "pattern" not in edge.child
    ]
    links = dict.fromkeys(frame for _, _, edge, _, _ in joints for frame in edge)
    text = ['<robot name="arm">'] + [f'<link name="{link}"/>' for link in links]
    for name, kind, edge, origin, axis in joints:
        xyz = " ".join(repr(float(v)) for v in origin[:3, 3])
        rpy = " ".join(repr(float(v)) for v in se3.rpy_from_rotation(origin[:3, :3]))
        axis_text = " ".join(repr(float(v)) for v in axis)
        limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>' if kind != "fixed" else ""
        text.append(
            f'<joint name="{name}" type="{kind}"><parent link="{edge.parent}"/>'
            f'<child link="{edge.child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<axis xyz="{axis_text}"/>{limit}</joint>'
        )
    return "\n".join([*text, "</robot>"])


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("joints")
    scene = arm.camera_on_arm(4, errors=ERRORS, collections=15)
    path = write_dataset_folder(scene.dataset, folder / "data", name="train")
    (folder / "arm.urdf").write_text(urdf_of(scene.dataset))
    code = main(
        [
            "calibrate",
            "--dataset",
            str(path),
            "--output",
            str(folder / "out"),
            "--description",
            str(folder / "arm.urdf"),
        ]
    )
    assert code == 0
    return scene, path, folder / "out"


def test_the_result_names_values_and_sigmas(calibrated):
    scene, _, out = calibrated
    document = json.loads((out / "calibration.json").read_text())
    assert {name: set(p) for name, p in document["joints"].items()} == {
        name: set(p) for name, p in ERRORS.items()
    }
    for name, parameters in document["joints"].items():
        for parameter, found in parameters.items():
            error = found["change"] - ERRORS[name][parameter]
            assert abs(error) < 5.0 * found["sigma"] < 0.01
            is_length = parameter in ("origin_x", "origin_z") or name == "telescope"
            assert found["unit"] == ("m" if is_length else "rad")
    parameters = yaml.safe_load((out / "atom_calibration_params.yml").read_text())
    assert parameters["joints"]["elbow"]["position_bias"] == pytest.approx(
        document["joints"]["elbow"]["position_bias"]["value"]
    )
    assert document["solver"]["parameters"] == 6 + 6 + 6  # camera, board, joints


def test_the_calibrated_dataset_carries_the_joints(calibrated):
    scene, path, out = calibrated
    written = json.loads((out / "atom_calibration.json").read_text())
    original = json.loads(path.read_text())
    for key, collection in written["collections"].items():
        before = original["collections"][key]["joints"]
        assert set(collection["joints"]) == set(arm.JOINT_NAMES)
        for name, joint in collection["joints"].items():
            changed = {k for k, v in joint.items() if before[name][k] != v}
            assert changed == set(ERRORS.get(name, ()))
    again = read_dataset(out / "atom_calibration.json")
    for collection in again.collections.values():
        for joint in collection.joints.values():
            np.testing.assert_allclose(
                collection.transforms[joint.edge], joint.parent_T_child, atol=1e-12
            )


def test_the_written_description_moves_as_the_calibrated_arm(calibrated):
    scene, _, out = calibrated
    robot = read_description(out / "optimized.urdf.xacro").robot
    solved = read_dataset(out / "atom_calibration.json")
    for collection in solved.collections.values():
        reported = {name: joint.position for name, joint in collection.joints.items()}
        edges = robot.transforms(reported)
        for joint in collection.joints.values():
            np.testing.assert_allclose(
                edges[joint.edge], collection.transforms[joint.edge], atol=1e-8
            )


def test_a_test_set_is_evaluated_with_the_calibrated_joints(calibrated):
    scene, _, out = calibrated
    train = read_dataset(out / "atom_calibration.json")
    test = arm.camera_on_arm(4, errors=ERRORS, collections=15).dataset
    mixed = mixed_dataset(train, test)
    true = {n: scene.dataset.joint(n).with_parameters({}) for n in arm.JOINT_NAMES}
    true = {
        name: joint.with_parameters(
            {p: joint.parameters[p] + e for p, e in ERRORS.get(name, {}).items()}
        )
        for name, joint in true.items()
    }
    for collection in mixed.collections.values():
        exact = {
            j.edge: replace(true[name], position=j.position).parent_T_child
            for name, j in collection.joints.items()
        }
        exact_collection = replace(collection, transforms={**collection.transforms, **exact})
        graph = mixed.graph
        found = pose(collection, graph, "arm_base", "flange")
        known = pose(exact_collection, graph, "arm_base", "flange")
        assert np.linalg.norm(found[:3, 3] - known[:3, 3]) < 2e-3
    collections = without_joints(test, test.collections)
    with pytest.raises(Exception, match="has no position of joint"):
        mixed_dataset(train, collections)


def test_options_select_and_hold_joints(calibrated, tmp_path, capsys):
    _, path, _ = calibrated
    common = ["calibrate", "-json", str(path)]
    # What is held is wrong, too, and says so.
    assert main([*common, "--output", str(tmp_path / "a"), "-jsf", "elbow"]) == 1
    document = json.loads((tmp_path / "a" / "calibration.json").read_text())
    assert document["status"] == "inconsistent"
    assert list(document["joints"]) == ["elbow"]
    assert "Calibrated joints" in capsys.readouterr().out
    assert main([*common, "--output", str(tmp_path / "b"), "-jpsf", "origin_z", "origin_yaw"]) == 1
    document = json.loads((tmp_path / "b" / "calibration.json").read_text())
    assert {n: set(p) for n, p in document["joints"].items()} == {
        "wrist_2": {"origin_z", "origin_yaw"}
    }
    assert main([*common, "--output", str(tmp_path / "c"), "--hold-joints"]) in (0, 1)
    assert json.loads((tmp_path / "c" / "calibration.json").read_text())["joints"] == {}
    capsys.readouterr()
    for wrong, message in (
        (["--joint-selection-function", "hip"], "no joint matches 'hip'"),
        (["--joint_parameter_selection_function", "speed"], "no joint parameter matches 'speed'"),
        (["--hold_joints", "-jsf", "elbow"], "--hold_joints holds what"),
    ):
        assert main([*common, "--output", str(tmp_path / "d"), *wrong]) == 2
        assert message in capsys.readouterr().err
        assert not (tmp_path / "d").exists()


# --------------------------------------------------------------------------------- model


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
def test_the_position_is_told_by_a_transform(kind):
    axis, origin = np.array([0.6, 0.0, 0.8]), se3.from_rpy(np.ones(3), np.array([0.1, 0.2, 0.3]))
    values = dict(zip(JOINT_PARAMETERS, (1.0, 1.0, 1.0, 0.1, 0.2, 0.3)))
    joint = JointState(Edge("a", "b"), kind, axis, 0.7, values)
    told = joint_from_pose(joint.edge, kind, axis, origin, joint.parent_T_child)
    assert told.position == pytest.approx(0.7)
    np.testing.assert_allclose(told.parent_T_child, joint.parent_T_child, atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [{"type": "floating"}, {"axis": np.zeros(3)}, {"position": np.nan}, {"axis": np.ones(2)}],
)
def test_a_joint_that_is_none_is_refused(change):
    arguments = {"edge": Edge("a", "b"), "type": "revolute", "axis": np.ones(3), "position": 0.0}
    with pytest.raises(ValueError, match="joint type|finite numbers"):
        JointState(**{**arguments, **change})


def test_a_damaged_joint_of_a_file_is_named(calibrated, tmp_path):
    _, path, _ = calibrated
    document = json.loads(path.read_text())
    del document["collections"]["002"]["joints"]["elbow"]["axis_y"]
    (tmp_path / "dataset.json").write_text(json.dumps(document))
    with pytest.raises(Exception, match="collection 002, joint 'elbow' lacks 'axis_y'"):
        read_dataset(tmp_path / "dataset.json")


def test_the_bias_is_a_parameter_that_the_configuration_may_name():
    assert JointConfig(("position_bias",)).params_to_calibrate == ("position_bias",)
