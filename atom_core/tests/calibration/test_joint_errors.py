"""Joints whose positions are off: named, and by the same amount in all collections estimated."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import AUTO, CalibrationOptions
from atom_core.calibration.refine.error_words import described
from atom_core.calibration.refine.joint_candidates import joint_candidates, sizes_on_moving_parts
from atom_core.calibration.refine.told_joints import told_joints
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.model_errors import (
    EdgeOffset,
    JointOffset,
    JointScale,
    JointShift,
    JointTilt,
    JointWave,
    PrismaticOffset,
)
from atom_core.problem.moving_blocks import MovingPart
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.stated_errors import stated_errors
from atom_core.report.verdict import GOOD
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import arm, scenes

OFF = float(np.radians(0.3))
HELD = CalibrationOptions(joints={})
MAKERS = {"camera": arm.camera_on_arm, "board": arm.board_on_arm}
MIDDLE = ("shoulder_lift", "elbow", "wrist_1", "wrist_2")  # the ends are like the sensor, the board


def candidates_of(dataset, problem):
    return joint_candidates(dataset, problem, told_joints(dataset, problem))


def with_offset(make, seed, joint, value):
    errors = {} if joint is None else {joint: {"position_bias": value}}
    return MAKERS[make](seed, errors=errors, collections=20)


def bent(q):
    return OFF * np.sin(q + 1.0)


def too_far(q):
    return 0.01 * q


def check_named(make, seed, joint, value):
    (check,) = calibrate(with_offset(make, seed, joint, value).dataset, HELD).checks
    assert check.error.title == f"joint offset of {joint}"
    assert check.value == pytest.approx(value, rel=0.25)
    assert check.error.option == f"-jsf {joint} -jpsf position_bias"


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("joint", ["shoulder_lift", "wrist_2"])
def test_a_joint_that_is_off_is_named_alone_with_its_size(make, joint):
    check_named(make, 0, joint, OFF)


@pytest.mark.parametrize("make", MAKERS)
def test_a_prismatic_one_too(make):
    check_named(make, 1, "telescope", -0.004)


@pytest.mark.long
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("joint", MIDDLE)
def test_in_nine_rigs_of_ten(make, joint):
    found = []
    for seed in range(10):
        checks = calibrate(with_offset(make, seed, joint, OFF).dataset, HELD).checks
        found.append(bool(checks) and checks[0].error.title == f"joint offset of {joint}")
    assert sum(found) >= 9


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize(
    "seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 20))]
)
def test_arms_that_are_as_described_show_nothing(make, seed):
    result = calibrate(with_offset(make, seed, None, 0.0).dataset, HELD)
    assert (result.status, result.checks, result.moving) == ("converged", (), ())


@pytest.mark.parametrize("solver", SOLVERS)
def test_auto_estimates_it_as_a_parameter_of_the_joint(solver):
    scene = with_offset("camera", 0, "elbow", OFF)
    options = CalibrationOptions(joints={}, model_errors="auto", solver_name=solver)
    result = calibrate(scene.dataset, options)
    assert result.status == "converged" and dict(result.free.joints) == {
        "elbow": ("position_bias",)
    }
    assert result.dataset.joint("elbow").parameters["position_bias"] == pytest.approx(OFF, rel=0.1)
    assert "estimated, since the data show it: joint offset of elbow" in result.warnings


def test_what_is_estimated_already_is_not_looked_for():
    scene = with_offset("camera", 0, "elbow", OFF)
    assert calibrate(scene.dataset).checks == ()


def test_sentences_tell_the_direction():
    none = np.zeros((0, 6))
    said = described(JointOffset("elbow", none), OFF, 0.1 * OFF)
    assert said == "the positions of joint elbow are 0.3 +- 0.03 deg too small"
    said = described(PrismaticOffset("boom", none), -0.004, 0.0002)
    assert said == "the positions of joint boom are 4 +- 0.2 mm too large"


# ---- errors that go with the position


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("lack", [bent, too_far])
def test_a_joint_that_bends_or_moves_too_far_is_named_though_its_offset_is_in_no_data(make, lack):
    scene = MAKERS[make](0, errors={}, lacks={"shoulder_pan": lack}, collections=20)
    result = calibrate(scene.dataset, HELD)
    assert result.status == "inconsistent"
    assert {check.error.target for check in result.checks} == {"shoulder_pan"}
    assert all(isinstance(check.error, (JointScale, JointWave)) for check in result.checks)
    assert "no option estimates it: have the arm calibrated" in result.message


@pytest.mark.sampled(6)
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("joint", ["shoulder_pan", "shoulder_lift", "elbow"])
@pytest.mark.parametrize("size_deg", [0.05, 0.1, 0.2])
def test_what_an_arm_that_bends_does_is_within_the_stated_sigmas_or_no_good_answer(
    make, joint, size_deg
):
    size = np.radians(size_deg)
    lacks = {joint: lambda q: size * np.cos(q + 0.5)}
    scene = MAKERS[make](1, errors={}, lacks=lacks, collections=20)
    results = calibration_results(calibrate(scene.dataset, HELD), "ceres")
    edge = scene.dataset.sensors["rgb_1"].edge
    true = scene.truth.edges[edge]
    off_m, off_rad = se3.pose_difference(results.calibration.dataset.first_value(edge), true)
    (stated,) = (e.combined_sigma for e in results.edges if e.edge == edge)
    if calibration_verdict(results).grade == GOOD:
        assert off_m < 3.0 * np.linalg.norm(stated[3:])
        assert off_rad < 3.0 * np.linalg.norm(stated[:3])


def test_sentences_tell_ratio_and_wave():
    none = np.zeros((0, 6))
    said = described(JointScale("elbow", none), -0.004, 0.0002)
    assert said.startswith("joint elbow moves 0.4 +- 0.02 % less than its positions say")
    said = described(JointWave("elbow", none, 1), -OFF, 0.1 * OFF)
    assert "lack 0.3 +- 0.03 deg times minus the cosine of its position" in said


def with_tilted_link(make, seed, monkeypatch, link, turn):
    """Return the scene of an arm one of whose links is turned against its description."""
    as_described = arm._edges

    def turned(states):
        edges = as_described(states)
        return {edge: pose @ turn if edge.child == link else pose for edge, pose in edges.items()}

    monkeypatch.setattr(arm._Wrong, "edges", lambda wrong, q: turned(wrong.states(q)))
    return MAKERS[make](seed, errors={}, collections=16)


@pytest.mark.parametrize(
    "make, seed, link, turns_deg",
    [
        ("camera", 0, "upper_arm", (0.3, 0.0, 0.0)),
        ("camera", 0, "boom", (0.3, 0.0, 0.0)),
        ("board", 0, "shoulder", (0.3, 0.0, 0.0)),
    ],
)
def test_a_tilted_axis_of_a_joint_is_in_the_combined_sigmas(
    make, seed, link, turns_deg, monkeypatch
):
    """These ended good, 4.3, 4.6 and 4.8 combined sigmas off."""
    turn = se3.from_rpy(np.zeros(3), np.radians(turns_deg))
    scene = with_tilted_link(make, seed, monkeypatch, link, turn)
    results = calibration_results(calibrate(scene.dataset, HELD), "any")
    (error,) = stated_errors(results.edges, scene.truth)
    assert error.in_combined_sigmas < 2.5
    assert error.in_sigmas > 4.0


def links_off(seed, size_m):
    """Return errors [m] of the lengths of links, drawn along every axis."""
    drawn = np.random.default_rng(seed)
    joints = ("telescope", "elbow", "wrist_1", "wrist_2")
    return {j: {f"origin_{a}": size_m * drawn.normal() for a in "xyz"} for j in joints}


@pytest.mark.parametrize("seed, collections, most", [(2, 18, 1.8), (6, 20, 3.5)])
def test_the_lengths_of_links_are_in_the_combined_sigmas_of_an_arm_that_has_room(
    seed, collections, most
):
    """`auto` takes what they do for chance: these ended good, 2.4 and 5.7 combined sigmas off."""
    errors = links_off(seed, 0.002)
    scene = MAKERS["camera"](seed, errors=errors, collections=collections)
    calibration = calibrate(scene.dataset, replace(HELD, model_errors=AUTO))
    assert calibration.free.moving
    (error,) = stated_errors(calibration_results(calibration, "any").edges, scene.truth)
    assert error.in_combined_sigmas < most


def test_axes_are_off_as_far_as_the_arm_that_has_room_and_others_as_usual():
    found = calibrate(MAKERS["camera"](0, errors={}, collections=4).dataset, HELD)
    dataset, graph = found.dataset, found.dataset.graph
    usual = {e: e.usual for e in candidates_of(dataset, found.problem)}
    carrier = graph.chain(dataset.world, "wrist_1_link")[-1].edge
    sizes = sizes_on_moving_parts(usual, dataset, {carrier: MovingPart(0.003, 0.002, {})})
    beyond = {"wrist_2", "wrist_3"}  # the arm that is off ends before them
    for error, size in sizes.items():
        off = {JointShift: 0.003, JointTilt: 0.002}.get(type(error), error.usual)
        assert size == (error.usual if error.target in beyond else off)


@pytest.mark.parametrize("kind, part", [(JointTilt, ROTATION), (JointShift, TRANSLATION)])
def test_axes_turn_and_shift_what_hangs_on_the_joint_across_themselves(kind, part):
    """By central differences of the chain, with the origin moved before the motion."""
    scene = MAKERS["camera"](0, errors={}, collections=4)
    found = calibrate(scene.dataset, HELD)
    errors = [e for e in candidates_of(found.dataset, found.problem) if isinstance(e, kind)]
    assert len(errors) == 2 * 7 and not any(e.is_named for e in errors)
    (one, other) = (e for e in errors if e.target == "elbow")
    dataset, graph = found.dataset, found.dataset.graph
    for d, key in enumerate(found.problem.detections):
        collection = dataset.collections[key.collection]
        joint = collection.joints["elbow"]
        frames = dataset.sensors[key.sensor].frame, dataset.patterns[key.pattern].frame
        moved = []
        for across in np.eye(3)[[0, 2]]:  # it turns about y
            both = []
            for size in (1e-5, -1e-5):
                twist = np.zeros(6)
                twist[part] = size * across
                move = se3.transform(se3.rotation_from_rotation_vector(twist[:3]), twist[3:])
                now = {**collection.transforms, joint.edge: joint.origin @ move @ joint.moved}
                both.append(pose(replace(collection, transforms=now), graph, *frames))
            off = both[0] @ se3.inverse(both[1])
            turned = se3.rotation_vector_from_rotation(off[:3, :3])
            moved.append(np.append(turned, off[:3, 3]) / 2e-5)
        plane = np.array(moved).T
        for error in (one, other):
            shares = np.linalg.lstsq(plane, error.twists[d], rcond=None)[0]
            np.testing.assert_allclose(plane @ shares, error.twists[d], atol=1e-4)
            assert np.linalg.norm(shares) == pytest.approx(1.0, abs=1e-4)


# ---- arms of which only /tf tells


def of_tf_alone(dataset):
    """Return a dataset without the positions of its joints."""
    collections = {k: replace(c, joints={}) for k, c in dataset.collections.items()}
    return replace(dataset, collections=collections)


@pytest.mark.parametrize("kind", [JointOffset, JointScale, JointWave, JointTilt, JointShift])
def test_transforms_tell_the_same_errors_of_joints_as_positions_do(kind):
    """Each edge of the arm turns about one axis, or shifts along one: that is its joint."""
    found = calibrate(MAKERS["camera"](0, errors={}, collections=6).dataset, HELD)

    def twists(dataset, target):
        errors = candidates_of(dataset, found.problem)
        mine = [e for e in errors if isinstance(e, kind) and e.target == target]
        assert all(not e.option for e in mine) or target in dataset.joints
        return np.array([e.twists.ravel() for e in mine])

    by_transforms = of_tf_alone(found.dataset)
    for name, joint in found.dataset.joints.items():
        known, told = twists(found.dataset, name), twists(by_transforms, str(joint.edge))
        assert known.shape == told.shape
        if len(known) == 0 or (kind, name) == (JointTilt, "telescope"):  # turned elsewhere on it
            continue
        shares = np.linalg.lstsq(known.T, told.T, rcond=None)[0]
        np.testing.assert_allclose(known.T @ shares, told.T, atol=1e-6)
        np.testing.assert_allclose(shares @ shares.T, np.eye(len(known)), atol=1e-4)


@pytest.mark.parametrize(
    "angles", [(0.0, 1.5, 3.0, 4.4), (2.1, -2.2, 0.8, -0.7), (0.0, 0.2, -0.4, 0.1)]
)
def test_a_joint_that_turns_far_has_the_positions_of_its_way(angles):
    """From half a turn on a transform alone has them come back from the other side."""
    found = calibrate(MAKERS["camera"](0, errors={}, collections=4).dataset, HELD)
    joint = found.dataset.joints["elbow"]
    turned = [replace(joint, position=angle).parent_T_child for angle in angles]
    changes = {key: {joint.edge: T} for key, T in zip(found.dataset.collections, turned)}
    dataset = of_tf_alone(found.dataset.with_transforms(changes))
    told = told_joints(dataset, found.problem)[str(joint.edge)].values()
    way = np.diff([state.position for state in told])
    assert np.allclose(way, np.diff(angles)) or np.allclose(-way, np.diff(angles))
    for state, T in zip(told, turned):
        np.testing.assert_allclose(state.parent_T_child, T, atol=1e-9)


def test_what_moves_in_all_directions_is_no_joint():
    found = calibrate(scenes.hand_eye(0, collections=5).dataset)
    assert told_joints(found.dataset, found.problem) == {}


@pytest.mark.parametrize(
    "make, seed, collections, joint, lack",
    [
        ("camera", 1, 15, "wrist_1", lambda q: 0.005 * np.cos(q)),
        ("board", 8, 13, "wrist_1", lambda q: -0.005),
        ("board", 10, 16, "elbow", lambda q: 0.005 * np.cos(q)),
        ("board", 6, 14, "elbow", lambda q: 0.02 * q),
    ],
)
@pytest.mark.parametrize("model_errors", ["suggest", AUTO])
def test_joints_of_which_only_tf_tells_are_in_the_combined_sigmas_or_named(
    make, seed, collections, joint, lack, model_errors
):
    """These ended good, 3.2 to 6.5 combined sigmas off; one of them inconsistent without auto."""
    scene = MAKERS[make](seed, errors={}, lacks={joint: lack}, collections=collections)
    options = replace(HELD, model_errors=model_errors)
    results = calibration_results(calibrate(of_tf_alone(scene.dataset), options), "any")
    (error,) = stated_errors(results.edges, scene.truth)
    assert error.in_combined_sigmas < 2.5


def test_the_offset_of_a_joint_of_which_only_tf_tells_says_what_to_record():
    said = described(EdgeOffset("upper_arm-forearm", np.zeros((0, 6))), OFF, 0.1 * OFF)
    assert said.startswith("the positions of joint upper_arm-forearm are 0.3 +- 0.03 deg too small")
    assert "record /joint_states" in said
