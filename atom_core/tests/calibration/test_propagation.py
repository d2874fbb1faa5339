"""Points carried from sensor to sensor: predicted deviations against drawn ones."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.propagation import propagate, sensor_pairs
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results, pairs_of
from atom_core.synthetic import paper_cell, scenes


@pytest.fixture(scope="module")
def calibration():
    return calibrate(paper_cell(0, disturbance=(0.02, 0.02)).dataset)


def joint_covariance(result, blocks):
    """Return the covariance (6 n, 6 n) of all parameters of some blocks."""
    rows, columns = (np.ravel(v) for v in np.meshgrid(blocks, blocks, indexing="ij"))
    parts = result.covariance.pairs(rows, columns).reshape(len(blocks), len(blocks), 6, 6)
    return parts.swapaxes(1, 2).reshape(6 * len(blocks), 6 * len(blocks))


@pytest.mark.sampled(1)
@pytest.mark.parametrize("scene", ["shared_edge", "cell"])
def test_predicted_deviations_are_those_of_parameters_drawn_from_the_covariance(scene, calibration):
    result = calibration
    if scene == "shared_edge":
        result = calibrate(scenes.shared_edge(0, collections=8).dataset)
    problem, dataset = result.problem, result.dataset
    shared = np.arange(problem.parameters.shared_count)
    factor = np.linalg.cholesky(joint_covariance(result, shared))
    pairs = pairs_of(result)
    carried = propagate(pairs, dataset.sensors, [2.0])
    rng, first = np.random.default_rng(0), next(iter(dataset.collections.values()))
    metres, pixels = [], []
    for _ in range(400):
        x = result.summary.x.copy()
        x[: 6 * len(shared)] += factor @ rng.standard_normal(len(factor))
        poses = problem.parameters.poses(x)
        moved = dict(first.transforms)
        moved.update({problem.parameters.blocks[i].edge: poses[i] for i in shared})
        collection = replace(first, transforms=moved)
        now, then = [], []
        for pair, (point,) in zip(pairs, carried):
            frames = dataset.sensors[pair.target].frame, dataset.sensors[pair.source].frame
            target_T_source = pose(collection, dataset.graph, *frames)
            at = point.point_in_source_m[None]
            ends = [se3.apply(m, at) for m in (target_T_source, pair.target_T_source)]
            now.append(np.sum((ends[0] - ends[1]) ** 2))
            camera = dataset.sensors[pair.target].camera
            if point.sigma_px is None:
                then.append(np.nan)
                continue
            then.append(np.sum((camera.project(ends[0]) - camera.project(ends[1])) ** 2))
        metres.append(now)
        pixels.append(then)
    # 400 draws of at least one degree of freedom: the variance is known to 7 %, 4 sigmas of that
    predicted = np.array([point.sigma_m for (point,) in carried])
    np.testing.assert_allclose(np.mean(metres, axis=0), predicted**2, rtol=0.28, atol=1e-20)
    seen = [i for i, (point,) in enumerate(carried) if point.sigma_px is not None]
    predicted = np.array([carried[i][0].sigma_px for i in seen])
    np.testing.assert_allclose(np.mean(pixels, axis=0)[seen], predicted**2, rtol=0.28, atol=1e-20)


def test_the_point_is_on_the_axis_or_where_the_target_sees_it(calibration):
    sensors = calibration.dataset.sensors
    for pair, points in zip(
        pairs_of(calibration), propagate(pairs_of(calibration), calibration.dataset.sensors)
    ):
        source, target = sensors[pair.source], sensors[pair.target]
        axis = np.eye(3)[0 if source.camera is None else 2]
        for point in points:
            at = point.point_in_source_m
            assert np.linalg.norm(at) == pytest.approx(point.distance_m)
            assert point.sigma_m > 0
            if target.camera is None:
                assert point.visible is None and point.sigma_px is None
                np.testing.assert_allclose(at, point.distance_m * axis)
                continue
            seen = target.camera.in_image(se3.apply(pair.target_T_source, at[None]))[0]
            assert seen == point.visible == (point.sigma_px is not None)


def test_sensors_on_one_edge_carry_exactly():
    result = calibrate(scenes.shared_edge(0, collections=8).dataset)
    sensors = list(result.dataset.sensors.values())
    one, other = next((a, b) for a in sensors for b in sensors if a != b and a.edge == b.edge)
    for pair, points in zip(pairs_of(result), propagate(pairs_of(result), result.dataset.sensors)):
        if {pair.source, pair.target} == {one.name, other.name}:
            assert all(point.sigma_m < 1e-9 for point in points)


def test_a_held_rig_has_no_deviation():
    result = calibrate(paper_cell(0).dataset)
    names = list(result.dataset.sensors)
    pairs = sensor_pairs(
        result.dataset, result.problem.parameters, result.summary.x, _NothingUncertain()
    )
    assert len(pairs) == len(names) * (len(names) - 1)
    for points in propagate(pairs, result.dataset.sensors):
        assert all(point.sigma_m == point.combined_sigma_m == 0 for point in points)


class _NothingUncertain:
    @property
    def combined(self):
        return self

    def states(self, index, jacobians):
        return np.zeros((len(index), 6, 6))


def test_the_document_holds_every_pair_at_three_distances(calibration):
    document = calibration_document(calibration_results(calibration, "ceres"), {})["propagation"]
    names = list(calibration.dataset.sensors)
    assert len(document) == len(names) * (len(names) - 1)
    assert {tuple(p["distance_m"] for p in e["points"]) for e in document} == {(1.0, 2.0, 4.0)}
