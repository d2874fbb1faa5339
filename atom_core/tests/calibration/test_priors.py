"""What is known beforehand of edges and joints: held near it, as sure as prior and data are."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.cli import main
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.config import PriorConfig
from atom_core.model.dataset import board_edge, pose
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION, TRANSLATION, PriorPoseBlock
from atom_core.problem.joint_blocks import JointBiasBlock
from atom_core.problem.parameters import Parameters
from atom_core.problem.priors import Prior
from atom_core.report.calibration_results import calibration_results
from atom_core.report.stated_errors import stated_errors
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import arm, degenerate, hand_eye, scenes

SIGMA_M, SIGMA_RAD = 0.01, 0.02
REDUNDANT = {"last": "wrist_3", "first": "shoulder_pan", "own": "elbow"}
# Only one of the joint's parameters has an imitator with a prior: it shares the deviation with it.
PREDICTED_RAD = {"last": SIGMA_RAD, "first": SIGMA_RAD, "own": SIGMA_RAD / np.sqrt(2.0)}


SIX = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def with_described(scene, edge, parent_T_child):
    """Return a scene's dataset, in which an edge is described otherwise."""
    changes = {key: {edge: parent_T_child} for key in scene.dataset.collections}
    return scene.dataset.with_transforms(changes)


def sigma_of(result, block_title, component):
    """Return the stated standard deviation of a parameter."""
    parameters = result.problem.parameters
    for i, block in enumerate(parameters.shared_blocks):
        if block.title == block_title and component in block.components:
            place = block.components.index(component)
            return float(np.sqrt(result.covariance.block(i)[place, place]))
    raise KeyError(component)


def edge_of(scene, sensor):
    return scene.dataset.sensors[sensor].edge


# ------------------------------------------------------------------------ what priors hold


@pytest.mark.parametrize("solver", sorted(SOLVERS))
@pytest.mark.parametrize("which", REDUNDANT)
def test_a_redundant_joint_is_as_sure_as_its_prior_allows(which, solver):
    scene, joint = degenerate.redundant_joint(1, which=which), REDUNDANT[which]
    options = CalibrationOptions(priors={joint: (SIGMA_M, SIGMA_RAD)}, solver_name=solver)
    result = calibrate(scene.dataset, options)
    assert result.status == "converged", result.message
    found = sigma_of(result, f"joint {joint}", "position_bias")
    assert found == pytest.approx(PREDICTED_RAD[which], rel=0.1)
    (held,) = result.held_directions
    assert held.priors == (joint,)
    assert f"joint {joint} position_bias" in held.parameters
    assert held.sigma == pytest.approx(PREDICTED_RAD[which], rel=0.1)
    assert not result.weak_directions


@pytest.mark.parametrize("solver", sorted(SOLVERS))
def test_priors_of_two_joints_about_one_axis_share_what_is_seen_of_both(solver):
    """Only the sum a + b of two deviations is seen: a has the sigma s t / sqrt(s^2 + t^2)."""
    scene = degenerate.redundant_joint(1, which="last")
    edge = edge_of(scene, "rgb_1")
    priors = {"wrist_3": (1.0, 0.01), "rgb_1": (0.5, 0.03)}
    result = calibrate(scene.dataset, CalibrationOptions(priors=priors, solver_name=solver))
    predicted = 0.01 * 0.03 / np.hypot(0.01, 0.03)
    assert sigma_of(result, "joint wrist_3", "position_bias") == pytest.approx(predicted, rel=0.1)
    assert {name for held in result.held_directions for name in held.priors} <= set(priors)
    assert edge in result.free.priors


@pytest.mark.parametrize("solver", sorted(SOLVERS))
def test_the_height_of_a_robot_on_a_plane_is_held(solver):
    scene = degenerate.planar_motion(2)
    options = CalibrationOptions(priors={"rgb_1": (SIGMA_M, 0.05)}, solver_name=solver)
    result = calibrate(scene.dataset, options)
    assert result.status == "converged", result.message
    (held,) = result.held_directions
    assert set(held.parameters) == {"rgb_1 z", "rgb_2 z", "pattern_1 z"}
    assert held.unit == "m"
    assert held.sigma == pytest.approx(SIGMA_M, rel=0.1)


def test_a_wide_prior_changes_nothing_that_the_data_tell():
    scene = hand_eye(0, collections=12)
    free, known = (
        calibrate(scene.dataset, CalibrationOptions(priors=priors))
        for priors in ({}, {"rgb_1": (1.0, 1.0)})
    )
    edge = edge_of(scene, "rgb_1")
    both = [r.dataset.first_value(edge) for r in (free, known)]
    np.testing.assert_allclose(both[0], both[1], atol=1e-6)
    assert known.held_directions == ()
    assert not known.priors[0].contradicted


def test_what_a_tight_prior_says_stays():
    scene = hand_eye(0, collections=12)
    result = calibrate(scene.dataset, CalibrationOptions(priors={"rgb_1": (1e-7, 1e-7)}))
    edge = edge_of(scene, "rgb_1")
    before, after = scene.dataset.first_value(edge), result.dataset.first_value(edge)
    np.testing.assert_allclose(after, before, atol=1e-6)


def test_a_disturbed_start_does_not_move_the_prior():
    scene = degenerate.redundant_joint(1, which="last")
    found = []
    for noise in ((0.0, 0.0), (0.05, 0.05)):
        options = CalibrationOptions(
            priors={"rgb_1": (SIGMA_M, SIGMA_RAD)}, noisy_initial_guess=noise
        )
        found.append(calibrate(scene.dataset, options).dataset.first_value(edge_of(scene, "rgb_1")))
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


def test_a_joint_that_is_disturbed_on_purpose_does_not_take_its_prior_along(tmp_path):
    """A joint that only its prior holds comes back to where it was described."""
    dataset = degenerate.redundant_joint(1, which="last", collections=8).dataset
    path = write_dataset_folder(dataset, tmp_path / "data", name="train")
    disturb = ["-jbn", "wrist_3", "-jbp", "position_bias", "-jbv", "0.05"]
    found = []
    for name, words in (("plain", []), ("disturbed", disturb)):
        known = ["--prior", "wrist_3", "0.001", "0.001"]
        assert run(path, tmp_path / name, *known, *words) == 0
        document = json.loads((tmp_path / name / "calibration.json").read_text())
        found.append(document["joints"]["wrist_3"]["position_bias"])
    assert found[1]["value"] == pytest.approx(found[0]["value"], abs=1e-6)
    assert found[1]["change"] == pytest.approx(found[0]["change"] - 0.05, abs=1e-6)


def test_a_prior_that_the_data_contradict_is_named():
    scene = hand_eye(0, collections=12)
    edge = edge_of(scene, "rgb_1")
    wrong = scene.dataset.first_value(edge) @ se3.transform(np.eye(3), np.array([0.03, 0.0, 0.0]))
    options = CalibrationOptions(priors={"rgb_1": (0.005, 0.01)})
    result = calibrate(with_described(scene, edge, wrong), options)
    assert result.status == "inconsistent"
    assert result.priors[0].contradicted
    assert "the data put 'rgb_1'" in result.message


def test_a_prior_alone_ties_a_rig_to_the_world():
    scene = degenerate.unanchored(1)
    result = calibrate(scene.dataset, CalibrationOptions(priors={"rgb_1": (0.002, 0.002)}))
    assert result.status == "converged", result.message
    assert any("only the prior of 'rgb_1' ties the rig" in w for w in result.warnings)
    sigma = sigma_of(result, "rgb_1", "z")
    assert sigma == pytest.approx(0.002, rel=0.1)


# ------------------------------------------------------------------------------- boards


def with_board_described(scene, off=None):
    """Return a scene's dataset that says where its board is, and that place."""
    pattern = scene.dataset.patterns["pattern_1"]
    place = next(iter(scene.truth.boards.values())) @ (np.eye(4) if off is None else off)
    return with_described(scene, board_edge(pattern), place), place


@pytest.mark.parametrize("solver", sorted(SOLVERS))
def test_a_board_that_is_known_holds_the_joint_that_its_place_imitates(solver):
    """A turn by a about the first axis moves a board at the distance r by r a."""
    scene = degenerate.redundant_joint(1, which="first")
    dataset, place = with_board_described(scene)
    options = CalibrationOptions(priors={"pattern_1": (SIGMA_M, SIGMA_RAD)}, solver_name=solver)
    result = calibrate(dataset, options)
    assert result.status == "converged", result.message
    collection = next(iter(dataset.collections.values()))
    child = dataset.joint("shoulder_pan").edge.child
    axis_T_board = pose(collection, dataset.graph, child, dataset.world) @ place
    predicted = 1.0 / np.sqrt(SIGMA_RAD**-2 + np.sum(axis_T_board[:2, 3] ** 2) / SIGMA_M**2)
    found = sigma_of(result, "joint shoulder_pan", "position_bias")
    assert found == pytest.approx(predicted, rel=0.1)
    (held,) = result.held_directions
    assert held.priors == ("pattern_1",)
    error = result.dataset.joint("shoulder_pan").parameters["position_bias"] - 0.01
    assert abs(error) < 4.0 * found


def test_a_board_where_it_is_not_is_contradicted_if_joint_and_camera_are_known():
    scene = hand_eye(0, collections=12)
    off = se3.transform(np.eye(3), np.array([0.03, 0.0, 0.0]))
    dataset, _ = with_board_described(scene, off)
    result = calibrate(dataset, CalibrationOptions(priors={"pattern_1": (0.002, 0.002)}))
    assert result.status == "inconsistent"
    assert "the data put 'pattern_1'" in result.message


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, "the dataset does not say where"),
        ({"anchor_patterns": True}, "pattern 'pattern_1' is not estimated (boards are held)"),
    ],
)
def test_a_board_of_which_nothing_can_be_known_is_refused(options, says):
    scene = hand_eye(0, collections=6)
    dataset = scene.dataset if not options else with_board_described(scene)[0]
    with pytest.raises(CalibrationError) as refused:
        calibrate(dataset, CalibrationOptions(priors={"pattern_1": (0.01, 0.01)}, **options))
    assert says in str(refused.value)


def test_the_configuration_is_named_where_its_prior_of_a_board_cannot_be():
    dataset = hand_eye(0, collections=6).dataset
    config = replace(dataset.config, priors={"pattern_1": PriorConfig(0.01, 0.02)})
    with pytest.raises(CalibrationError, match="priors of the configuration: pattern_1: the data"):
        calibrate(replace(dataset, config=config), CalibrationOptions())


def test_a_board_that_is_carried_about_has_no_prior():
    scene = scenes.random_scene(1, rgb=2, depth=0, lidar3d=0, collections=4)
    with pytest.raises(CalibrationError, match="as it is carried about"):
        calibrate(scene.dataset, CalibrationOptions(priors={"pattern_1": (0.01, 0.01)}))


def test_six_joints_are_found_with_what_is_known_of_the_first_and_the_last():
    biases = dict(zip(SIX, (0.0004, 0.03, -0.02, 0.03, -0.03, -0.0003)))
    errors = {joint: {"position_bias": bias} for joint, bias in biases.items()}
    scene = arm.camera_on_arm(3, errors=errors, collections=16)
    known = dict.fromkeys((SIX[0], SIX[-1]), (0.001, 0.0005))
    result = calibrate(scene.dataset, CalibrationOptions(priors=known))
    assert result.status == "converged", result.message
    for joint, bias in biases.items():
        sigma = sigma_of(result, f"joint {joint}", "position_bias")
        error = result.dataset.joint(joint).parameters["position_bias"] - bias
        assert abs(error) < 4.0 * sigma
    held = {name for direction in result.held_directions for name in direction.priors}
    assert held == set(known)
    alone = calibrate(scene.dataset, CalibrationOptions())
    assert alone.status == "rank_deficient"


# --------------------------------------------------------------------------------- coverage


def covered(seeds, solver=None):
    """Return the errors of joint and camera in their sigmas (n,), truth drawn from the priors."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 77])
        bias = float(rng.normal(0.0, SIGMA_RAD))
        scene = arm.camera_on_arm(seed, errors={"wrist_3": {"position_bias": bias}}, collections=14)
        edge = edge_of(scene, "rgb_1")
        true = scene.dataset.first_value(edge)
        turn = se3.rotation_from_rotation_vector(rng.normal(0.0, SIGMA_RAD, 3))
        shift = rng.normal(0.0, SIGMA_M, 3)
        described = se3.transform(true[:3, :3] @ turn, true[:3, 3] + shift)
        priors = {"rgb_1": (SIGMA_M, SIGMA_RAD), "wrist_3": (SIGMA_M, SIGMA_RAD)}
        options = CalibrationOptions(priors=priors, solver_name=solver)
        result = calibrate(with_described(scene, edge, described), options)
        assert result.status == "converged", result.message
        error = result.dataset.joint("wrist_3").parameters["position_bias"] - bias
        found.append([error / sigma_of(result, "joint wrist_3", "position_bias")])
        results = calibration_results(result, "ceres", scene.truth)
        (stated,) = stated_errors(results.edges, scene.truth)
        found.append(stated.error / stated.sigma)
    return np.concatenate(found)


def test_errors_of_held_edges_and_joints_are_as_large_as_their_sigmas():
    off = covered(range(6))
    assert 0.4 < np.sqrt(np.mean(off**2)) < 1.4
    assert np.max(np.abs(off)) < 4.0


@pytest.mark.long
def test_intervals_with_priors_of_the_truths_own_size_hold_the_truth():
    off = covered(range(400))
    assert 0.92 <= np.mean(np.abs(off) < 1.96) <= 0.98
    joint = off.reshape(-1, 7)[:, 0]
    assert 0.90 <= np.mean(np.abs(joint) < 1.96) <= 0.99


def joints_covered_by_boards(seeds):
    """Return a first joint's errors in its sigmas; its board's place is drawn from its prior."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 78])
        turn = se3.rotation_from_rotation_vector(rng.normal(0.0, SIGMA_RAD, 3))
        off = se3.transform(turn, rng.normal(0.0, SIGMA_M, 3))
        scene = degenerate.redundant_joint(seed, which="first", collections=12)
        dataset, _ = with_board_described(scene, off)
        result = calibrate(dataset, CalibrationOptions(priors={"pattern_1": (SIGMA_M, SIGMA_RAD)}))
        assert result.status == "converged", result.message
        error = result.dataset.joint("shoulder_pan").parameters["position_bias"] - 0.01
        found.append(error / sigma_of(result, "joint shoulder_pan", "position_bias"))
    return np.array(found)


def test_a_joint_is_as_far_off_as_the_prior_of_its_board_says():
    off = joints_covered_by_boards(range(8))
    assert 0.4 < np.sqrt(np.mean(off**2)) < 1.7 and np.max(np.abs(off)) < 4.0


@pytest.mark.long
def test_intervals_with_priors_of_boards_hold_the_truth():
    off = joints_covered_by_boards(range(300))
    assert 0.92 <= np.mean(np.abs(off) < 1.96) <= 0.98


# ----------------------------------------------------------------------------------- blocks


def test_the_prior_of_a_pose_is_least_where_it_was_described():
    rng = np.random.default_rng(0)
    given, start = (
        se3.transform(
            se3.rotation_from_rotation_vector(rng.normal(0, 0.1, 3)), rng.normal(0, 0.1, 3)
        )
        for _ in range(2)
    )
    stated = Prior("s", 0.001, 0.002, {"000": given})
    edge = Edge("a", "b")
    block = PriorPoseBlock(edge, "sensor", None, ("s",), start, given, 0.001, 0.002, stated)
    np.testing.assert_allclose(block.pose(block.prior_mean), given, atol=1e-12)
    assert np.all(block.prior_weight[ROTATION] == pytest.approx(0.002**-2))
    assert np.all(block.prior_weight[TRANSLATION] == pytest.approx(0.001**-2))
    parameters = Parameters([block])
    assert parameters.has_prior
    assert not parameters.without_priors().has_prior


def test_the_prior_of_a_joint_is_of_what_is_estimated_alone():
    stated = Prior("j", 0.001, 0.002, parameters={"position_bias": 0.3})
    axis = np.array([0.0, 0.0, 1.0])
    block = JointBiasBlock(Edge("a", "b"), "joint", None, ("j",), axis, False, 0.1, stated)
    assert block.prior_mean == pytest.approx([0.2, 0, 0, 0, 0, 0])
    assert block.prior_weight == pytest.approx([0.002**-2, 0, 0, 0, 0, 0])
    assert np.all(block.without_prior().prior_weight == 0.0)


# -------------------------------------------------------------------- options and bad input


@pytest.fixture(scope="module")
def dataset_file(tmp_path_factory):
    """Return the file of a dataset with a prior in its configuration, and without."""
    dataset = degenerate.redundant_joint(1, which="last", collections=8).dataset
    known = replace(dataset.config, priors={"wrist_3": PriorConfig(0.01, 0.02)})
    path = write_dataset_folder(dataset, tmp_path_factory.mktemp("data"), name="train")
    document = json.loads(path.read_text())
    document["calibration_config"] = known.to_document()
    (path.parent / "known.json").write_text(json.dumps(document))
    return path


def run(path, out, *words):
    return main(["calibrate", "-json", str(path), "--output", str(out), *words])


def test_what_only_a_prior_holds_is_said_in_table_and_document(dataset_file, tmp_path, capsys):
    assert run(dataset_file, tmp_path / "out", "--prior", "wrist_3", "0.01", "0.02") == 0
    text = capsys.readouterr().out
    assert "held by prior of wrist_3: " in text
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    (held,) = document["held_by_prior"]
    assert held["priors"] == ["wrist_3"]
    assert held["sigma"] == pytest.approx(0.02, rel=0.1)
    joint = document["joints"]["wrist_3"]["position_bias"]
    assert joint["held_by_prior"]
    assert joint["prior_sigma"] == 0.02
    (edge,) = document["edges"].values()
    assert edge["held_by_prior"]
    assert edge["prior_sigma_m"] is None
    assert [prior["name"] for prior in document["priors"]] == ["wrist_3"]


@pytest.mark.parametrize(
    ("words", "sigma"), [((), 0.02), (("--prior", "wrist_3", "0.01", "0.03"), 0.03)]
)
def test_a_prior_of_the_configuration_counts_and_an_option_takes_its_place(
    words, sigma, dataset_file, tmp_path
):
    assert run(dataset_file.parent / "known.json", tmp_path / "out", *words) == 0
    result = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert result["joints"]["wrist_3"]["position_bias"]["prior_sigma"] == sigma


def test_a_configured_prior_of_what_is_held_now_is_remarked():
    dataset = degenerate.redundant_joint(1, which="last").dataset
    config = replace(dataset.config, priors={"wrist_3": PriorConfig(0.01, 0.02)})
    result = calibrate(replace(dataset, config=config), CalibrationOptions(joints={}))
    assert any("prior of 'wrist_3' has no effect" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--prior", "lens", "0.01", "0.02"], "there is no such sensor, additional tf, joint"),
        (["--prior", "elbow", "0.01", "0.02"], "joint 'elbow' is not estimated"),
        (["--prior", "rgb_1", "0.01", "0.02", "-as", "rgb_1"], "is not estimated (it is held)"),
        (["--prior", "world-arm_base", "0.1", "0.1"], "edge 'world-arm_base' is not estimated"),
        (["--prior", "rgb_1", "0", "0.02"], "needs two figures > 0, metres and radians"),
        (["--prior", "rgb_1", "0.01", "-0.02"], "needs two figures > 0, metres and radians"),
        (["--prior", "rgb_1", "nan", "0.02"], "needs two figures > 0, metres and radians"),
        (["--prior", "rgb_1", "0.01", "much"], "needs two figures > 0, metres and radians"),
        (["--prior", "rgb_1", "1", "1", "--prior", "rgb_1", "2", "2"], "stands twice"),
        (
            ["--prior", "rgb_1", "1", "1", "--prior", "flange-rgb_1_link", "2", "2"],
            "has a prior already, that of 'rgb_1'",
        ),
        (["--prior", "rgb_1", "1", "1", "--weights", "atom"], "--prior needs --weights sigma"),
    ],
)
def test_a_prior_that_cannot_be_is_refused_in_one_sentence(
    words, sentence, dataset_file, tmp_path, capsys
):
    assert run(dataset_file, tmp_path / "out", *words) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert len(error.strip().splitlines()) == 1


def test_a_prior_of_nothing_in_a_configuration_is_refused():
    dataset = degenerate.redundant_joint(1, which="last").dataset
    document = dataset.config.to_document()
    assert "priors" not in document
    document["priors"] = {"lens": {"sigma_m": 0.01, "sigma_rad": 0.01}}
    with pytest.raises(Exception, match="is of no sensor, additional tf, joint or fixed"):
        type(dataset.config).from_document(document, "config.yml")


def test_options_refuse_standard_deviations_that_are_none():
    with pytest.raises(ValueError, match="needs two numbers > 0"):
        CalibrationOptions(priors={"rgb_1": (0.0, 1.0)})
    with pytest.raises(ValueError, match="must be larger than 0"):
        Prior("s", 1.0, float("nan"))
    with pytest.raises(CalibrationError, match="needs --weights sigma"):
        scene = hand_eye(0, collections=6)
        solver = replace(CalibrationOptions().solver, weights="atom")
        calibrate(scene.dataset, CalibrationOptions(solver=solver, priors={"rgb_1": (1.0, 1.0)}))
