"""A sensor in another one and an edge in two calibrations: covariances follow from the geometry."""

from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.edge_spread import edge_spread, known_spread
from atom_core.evaluation.spreads import joint_covariance
from atom_core.evaluation.trust import relative as module
from atom_core.evaluation.trust.relative import (
    difference,
    jacobian,
    largest_in_sigmas,
    relative_pose,
    stepped,
)
from atom_core.evaluation.trust.two_estimates import edge_difference
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

QUIET = CalibrationOptions(model_errors=OFF)


@pytest.fixture(scope="module")
def solved():
    """Return two cameras, the first one anchored, solved with each half of the collections."""
    dataset = scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=8).dataset
    keys = list(dataset.collections)
    return [calibrate(dataset.selected(collections=keys[i::2]), QUIET) for i in (0, 1)]


def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def slope_of(calibration, target, sensor):
    """Return how a turn and shift of a sensor's edge turn and shift its frame in a held one."""
    dataset = calibration.dataset
    first, graph = next(iter(dataset.collections.values())), dataset.graph
    edge, frame = dataset.sensors[sensor].edge, dataset.sensors[sensor].frame
    turn = pose(first, graph, dataset.sensors[target].frame, edge.parent)[:3, :3]
    arm = (
        pose(first, graph, edge.parent, frame)[:3, 3]
        - pose(first, graph, edge.parent, edge.child)[:3, 3]
    )
    return np.block([[turn, np.zeros((3, 3))], [-turn @ skew(arm), turn]])


# ---- a sensor in another one


@pytest.mark.parametrize("sensor", ["rgb_2", "rgb_3"])
def test_in_a_held_sensor_an_edges_covariance_is_turned_and_felt_at_the_arm(solved, sensor):
    calibration = solved[0]
    found = relative_pose(calibration, "rgb_1", sensor)
    slope = slope_of(calibration, "rgb_1", sensor)
    own = edge_spread(calibration, calibration.dataset.sensors[sensor].edge)
    wanted = slope @ own @ slope.T
    sigma = np.sqrt(np.diagonal(wanted))
    np.testing.assert_allclose(
        found.covariance / np.outer(sigma, sigma), wanted / np.outer(sigma, sigma), atol=1e-4
    )


def test_of_two_free_sensors_both_covariances_count(solved):
    """Carried into the held one: the second in the first adds what both are unsure of."""
    calibration = solved[0]
    turn = relative_pose(calibration, "rgb_1", "rgb_2").target_T_source[:3, :3]
    found = relative_pose(calibration, "rgb_2", "rgb_3").covariance[:3, :3]
    each = [
        relative_pose(calibration, "rgb_1", name).covariance[:3, :3] for name in ("rgb_2", "rgb_3")
    ]
    np.testing.assert_allclose(turn @ found @ turn.T, sum(each), rtol=1e-3, atol=1e-12)


def test_the_pose_is_that_of_the_data_frames_and_its_inverse_the_other_way(solved):
    dataset = solved[0].dataset
    first = next(iter(dataset.collections.values()))
    frames = (dataset.sensors[name].frame for name in ("rgb_3", "rgb_2"))
    forth = relative_pose(solved[0], "rgb_3", "rgb_2").target_T_source
    np.testing.assert_allclose(forth, pose(first, dataset.graph, *frames), atol=1e-12)
    back = relative_pose(solved[0], "rgb_2", "rgb_3").target_T_source
    np.testing.assert_allclose(forth @ back, np.eye(4), atol=1e-12)


def test_a_sensor_in_itself_is_known_exactly(solved):
    found = relative_pose(solved[0], "rgb_2", "rgb_2")
    np.testing.assert_allclose(found.target_T_source, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(found.covariance, 0.0, atol=1e-12)


def test_one_edge_moves_and_the_others_stay(solved):
    first = next(iter(solved[0].dataset.collections.values()))
    edge = solved[0].dataset.sensors["rgb_2"].edge
    numbers = np.array([0.0, 0.0, 0.1, 1.0, 2.0, 3.0])
    moved = module._with_edge(first, edge, numbers)
    assert moved.key == first.key and set(moved.transforms) == set(first.transforms)
    for other, value in first.transforms.items():
        if other == edge:
            found = difference(value, moved.transforms[other])
            np.testing.assert_allclose(found, numbers, atol=1e-12)
        else:
            assert moved.transforms[other] is value


def test_values_of_one_collection_and_edges_that_are_nowhere_do_not_count(monkeypatch, solved):
    """Nor do they cost the later ones anything."""
    dataset = solved[0].dataset
    edge = dataset.sensors["rgb_2"].edge
    own = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    blocks = [
        SimpleNamespace(edge=edge, collection="000"),
        SimpleNamespace(edge=Edge("world", "nowhere"), collection=None),
        SimpleNamespace(edge=edge, collection=None),
    ]
    parameters = SimpleNamespace(
        pose_blocks=lambda: list(enumerate(blocks)), slice_of=lambda i: slice(i, i + 1)
    )
    calibration = SimpleNamespace(
        dataset=dataset,
        problem=SimpleNamespace(parameters=parameters),
        summary=SimpleNamespace(x=np.arange(3.0)),
        covariance=SimpleNamespace(block=lambda i: i * own),
    )
    monkeypatch.setattr(module, "edge_covariance", lambda block, x, covariance: covariance)
    slope = slope_of(calibration, "rgb_1", "rgb_2")
    found = relative_pose(calibration, "rgb_1", "rgb_2").covariance
    np.testing.assert_allclose(found, slope @ (2.0 * own) @ slope.T, rtol=1e-3, atol=1e-3)


# ---- numbers of poses


def test_a_difference_is_a_turn_before_a_shift_in_outer_axes():
    start = se3.random_move(1.0, 1.0, np.random.default_rng(0))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    other = se3.transform(quarter @ start[:3, :3], start[:3, 3] + [1.0, -2.0, 3.0])
    wanted = [0.0, 0.0, np.pi / 2.0, 1.0, -2.0, 3.0]
    np.testing.assert_allclose(difference(start, other), wanted, atol=1e-9)
    np.testing.assert_allclose(difference(other, start), -np.array(wanted), atol=1e-9)
    np.testing.assert_allclose(stepped(start, np.array(wanted)), other, atol=1e-9)


def test_a_slope_is_that_at_zero_of_a_bent_function_too():
    bend = np.arange(1.0, 7.0)

    def bent(numbers):
        shift = [np.sum(bend * numbers), np.sum(numbers**2), np.sin(numbers[5])]
        return se3.transform(np.eye(3), np.array(shift))

    wanted = np.zeros((6, 6))
    wanted[3], wanted[5, 5] = bend, 1.0
    np.testing.assert_allclose(jacobian(bent, bent(np.zeros(6))), wanted, atol=1e-5)


def test_the_largest_is_in_its_own_sigma_whatever_its_sign():
    covariance = np.array([[4.0, 1.9], [1.9, 1.0]])
    assert largest_in_sigmas(np.array([-6.0, 2.0]), covariance) == pytest.approx(3.0)
    assert largest_in_sigmas(np.array([2.0, -6.0]), covariance) == pytest.approx(6.0)


def test_what_has_no_covariance_is_known_to_a_billionth():
    assert largest_in_sigmas(np.array([3e-9]), np.zeros((1, 1))) == pytest.approx(3.0)
    assert largest_in_sigmas(np.array([3e-9]), np.array([[4e-18]])) == pytest.approx(1.5)


# ---- one edge in two calibrations


def test_two_calibrations_differ_as_their_edges_do_and_are_known_by_both(solved):
    one, other = solved
    edge = one.dataset.sensors["rgb_2"].edge
    numbers, covariance = edge_difference(one, other, edge)
    values = [part.dataset.first_value(edge) for part in solved]
    np.testing.assert_allclose(numbers, difference(*values))
    np.testing.assert_allclose(numbers[3:], values[1][:3, 3] - values[0][:3, 3])
    assert np.linalg.norm(numbers[3:]) > 1e-5
    wanted = joint_covariance(known_spread(one, edge), known_spread(other, edge))
    np.testing.assert_allclose(covariance, wanted)
    back, the_same = edge_difference(other, one, edge)
    np.testing.assert_allclose(back, -numbers, atol=1e-12)
    np.testing.assert_allclose(the_same, covariance)


def test_a_calibration_does_not_differ_from_itself(solved):
    edge = solved[0].dataset.sensors["rgb_3"].edge
    numbers, covariance = edge_difference(solved[0], solved[0], edge)
    np.testing.assert_allclose(numbers, 0.0, atol=1e-12)
    assert np.all(np.diagonal(covariance) > 0.0)


def test_an_edge_that_both_hold_has_no_covariance(solved):
    edge = solved[0].dataset.sensors["rgb_1"].edge
    numbers, covariance = edge_difference(*solved, edge)
    np.testing.assert_array_equal(covariance, 0.0)
    np.testing.assert_allclose(numbers, 0.0, atol=1e-12)
