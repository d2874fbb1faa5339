"""Blocks of joints: the pose they make, its derivatives, and what is expected of their numbers."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.joints import POSITION_BIAS, PRISMATIC, REVOLUTE, JointState
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import JOINT
from atom_core.problem.joint_blocks import ORIGIN_PARAMETERS, JointBiasBlock, JointOriginBlock
from atom_core.problem.priors import Prior

EDGE = Edge("upper_arm", "forearm")
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ORIGIN = np.array([0.3, -0.5, 1.1, 0.4, -0.2, 0.7])
SOME = np.array([True, False, True, False, True, True])
ALL = np.ones(6, dtype=bool)
X = np.array([0.05, -0.03, 0.02, 0.01, -0.04, 0.06])
DESCRIBED = {name: 0.1 * (i + 1) for i, name in enumerate(ORIGIN_PARAMETERS)}
STATED = Prior("elbow", 0.01, 0.002, parameters={**DESCRIBED, POSITION_BIAS: 0.25})


def origin(selected=ALL, stated=None):
    return JointOriginBlock(EDGE, JOINT, None, ("elbow",), ORIGIN, selected, stated)


def bias(is_prismatic, stated=None):
    return JointBiasBlock(EDGE, JOINT, None, ("elbow",), AXIS, is_prismatic, 0.2, stated)


BLOCKS = {
    "whole origin": origin(),
    "part of an origin": origin(SOME),
    "turning": bias(False),
    "sliding": bias(True),
}


@pytest.fixture(params=BLOCKS)
def block(request):
    return BLOCKS[request.param]


def test_the_twist_jacobian_against_central_differences(block):
    h, found = 1e-6, block.twist_jacobian(X)
    for i in range(6):
        step = h * np.eye(6)[i]
        ahead, behind = block.pose(X + step), block.pose(X - step)
        change = (ahead - behind) / (2.0 * h)
        turn = change[:3, :3] @ block.pose(X)[:3, :3].T
        expected = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
        np.testing.assert_allclose(found[:3, i], expected, atol=1e-8)
        move = change[:3, 3] - np.cross(expected, block.pose(X)[:3, 3])
        np.testing.assert_allclose(found[3:, i], move, atol=1e-8)


def test_numbers_that_are_not_estimated_change_nothing(block):
    other = np.where(block.free, X, 7.0)
    np.testing.assert_array_equal(block.pose(other), block.pose(X))
    np.testing.assert_array_equal(block.values(other), block.values(X))
    assert not block.twist_jacobian(X)[:, ~block.free].any()


def test_at_zero_the_values_are_the_initial_ones(block):
    np.testing.assert_array_equal(block.values(np.zeros(6)), block.initial_values)
    assert set(block.free_values(X)) == {name for _, name in block.free_components}
    for i, name in block.free_components:
        assert block.free_values(X)[name] == pytest.approx(block.initial_values[i] + X[i])


def test_both_factors_make_the_pose_of_the_joint():
    for kind in (REVOLUTE, PRISMATIC):
        values = dict(zip(ORIGIN_PARAMETERS, ORIGIN + X))
        sliding = kind == PRISMATIC
        values[POSITION_BIAS] = 0.2 + (X[3] if sliding else X[0])
        joint = JointState(EDGE, kind, AXIS, 0.0, values)
        np.testing.assert_allclose(
            origin().pose(X) @ bias(sliding).pose(X), joint.parent_T_child, atol=1e-12
        )


def test_an_origin_is_turned_about_fixed_axes_as_in_urdf():
    block = JointOriginBlock(EDGE, JOINT, None, ("elbow",), np.zeros(6), ALL)
    quarter = np.array([0.0, np.pi / 2, np.pi / 2, 1.0, 2.0, 3.0])  # about y, then about z
    np.testing.assert_allclose(
        se3.apply(block.pose(quarter), np.eye(3)),
        np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) + [1.0, 2.0, 3.0],
        atol=1e-12,
    )


def test_a_bias_is_the_first_angle_or_the_first_length():
    turning, sliding = bias(False), bias(True)
    assert (turning.place, sliding.place) == (0, 3)
    assert turning.components == (POSITION_BIAS, "", "", "", "", "")
    assert sliding.components == ("", "", "", POSITION_BIAS, "", "")
    assert turning.units[turning.place] == "rad" and sliding.units[sliding.place] == "m"
    np.testing.assert_array_equal(turning.initial_values, [0.2, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(sliding.initial_values, [0, 0, 0, 0.2, 0, 0])


def test_names_of_an_origin_stand_before_their_units():
    block = origin()
    assert block.components == ORIGIN_PARAMETERS
    for name, unit, is_angle in zip(block.components, block.units, block.is_angle):
        assert is_angle == (unit == "rad") == name.endswith(("roll", "pitch", "yaw"))
    assert block.title == "joint elbow" and block.joint == "elbow"


def test_nothing_is_expected_of_a_joint_that_nothing_is_known_of(block):
    assert block.prior is None
    assert not block.prior_mean.any() and not block.prior_weight.any()
    assert block.prior_mean.shape == block.prior_weight.shape == (6,)


@pytest.mark.parametrize("selected", [ALL, SOME])
def test_an_origin_is_expected_as_described(selected):
    block = origin(selected, STATED)
    values = block.values(block.prior_mean)
    expected = np.where(selected, [DESCRIBED[name] for name in ORIGIN_PARAMETERS], ORIGIN)
    np.testing.assert_allclose(values, expected)
    assert not block.prior_mean[~selected].any()
    weight = np.array([1 / 0.002**2] * 3 + [1 / 0.01**2] * 3)
    np.testing.assert_allclose(block.prior_weight, np.where(selected, weight, 0.0))


@pytest.mark.parametrize("is_prismatic, sigma", [(False, 0.002), (True, 0.01)])
def test_a_bias_is_expected_as_described(is_prismatic, sigma):
    block = bias(is_prismatic, STATED)
    assert block.values(block.prior_mean)[block.place] == pytest.approx(0.25)
    assert np.count_nonzero(block.prior_mean) == np.count_nonzero(block.prior_weight) == 1
    assert block.prior_weight[block.place] == pytest.approx(sigma**-2)


def test_a_parameter_that_is_not_described_is_expected_at_zero():
    block = origin(ALL, Prior("elbow", 0.01, 0.002, parameters={"origin_x": 0.5}))
    expected = np.where(np.arange(6) == 3, 0.5, 0.0)
    np.testing.assert_allclose(block.values(block.prior_mean), expected, atol=1e-15)


@pytest.mark.parametrize("known", [origin(SOME, STATED), bias(False, STATED), bias(True, STATED)])
def test_without_what_is_known_a_block_is_the_same_but_free(known):
    plain = known.without_prior()
    assert known.prior is STATED and plain.prior is None
    assert not plain.prior_weight.any() and not plain.prior_mean.any()
    np.testing.assert_array_equal(plain.pose(X), known.pose(X))
    np.testing.assert_array_equal(plain.free, known.free)
