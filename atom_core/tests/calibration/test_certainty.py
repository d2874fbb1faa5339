"""Is what the calibration says of its certainty true? Many rigs, drawn with known noise.

A hundred of them are long, a few are for every day.
"""

from typing import NamedTuple

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.propagation import propagate
from atom_core.calibration.judge.weak_directions import edge_covariance
from atom_core.geometry import se3
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.model.dataset import pose
from atom_core.model.sensor import RGB
from atom_core.model.truth import with_truth
from atom_core.problem.blocks import SENSOR
from atom_core.problem.residuals import ORTHOGONAL, REPROJECTION
from atom_core.report.calibration_results import calibration_results, pairs_of
from atom_core.report.stated_errors import stated_errors
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import SLIGHT, Noise, paper_cell, scenes

# every sensor has its own noise
NOISE = Noise(
    depth_scale=1.3,
    sensors={
        "rgb_1": Noise(corner_px=0.2),
        "rgb_3": Noise(corner_px=0.4),
        "lidar_1": Noise(lidar_m=0.007),
        "lidar_3": Noise(lidar_m=0.014),
    },
)


class Run(NamedTuple):
    """What one rig tells.

    Attributes:
        errors, covariances: of each free sensor's edge, (6,) and (6, 6), in the parent's axes.
        sigmas: by sensor and kind, estimated over planted standard deviation.
        carried: by (source, target), squared displacement of a point at 2 m over its predicted
            square: in the image where it is visible, else in space.
    """

    errors: dict
    covariances: dict
    sigmas: dict
    carried: dict


def run(seed):
    scene = paper_cell(seed, "train", NOISE, (0.02, 0.02))
    result = calibrate(scene.dataset)
    errors, covariances = {}, {}
    transforms = next(iter(result.dataset.collections.values())).transforms
    for i, block in enumerate(result.problem.parameters.blocks):
        if block.kind == SENSOR:
            found, true = transforms[block.edge], scene.truth.edges[block.edge]
            turn = se3.rotation_vector_from_rotation(found[:3, :3] @ true[:3, :3].T)
            x = result.summary.x[result.problem.parameters.slice_of(i)]
            (name,) = block.names
            errors[name] = np.concatenate([turn, found[:3, 3] - true[:3, 3]])
            covariances[name] = edge_covariance(block, x, result.covariance.block(i))
    return Run(errors, covariances, sigma_ratios(result), carried_ratios(result, scene))


def sigma_ratios(result):
    """Return estimated over planted sigmas; those of ranges are seen along the board's normal."""
    problem, summary = result.problem, result.summary
    poses, ratios = problem.poses(summary.x), {}
    for block, sigma in zip(problem.residual_blocks, summary.sigmas):
        noise = NOISE.of(block.sensor)
        if block.kind == REPROJECTION:
            planted = np.full(block.count, noise.corner_px)
        elif block.kind == ORTHOGONAL:
            along_ray = np.full(block.count, noise.lidar_m)
            if block.modality == "depth":
                depth = block.points[:, 2]
                stretch = np.linalg.norm(block.points, axis=1) / depth
                along_ray = noise.depth_scale * depth_sigma_m(depth) * stretch
            outward = block.linearise(poses)[1][:, 0, 3:]
            planted = along_ray * np.abs(np.einsum("ni,ni->n", outward, block.rays))
        else:
            continue  # how far limit points lie inside the border is the sampling's doing
        relative = planted / block.sigma
        ratios[(block.sensor, block.kind)] = np.median(sigma / block.sigma) / np.sqrt(
            np.mean(relative**2)
        )
    return ratios


def carried_ratios(result, scene):
    dataset = result.dataset
    truth = with_truth(scene.dataset, scene.truth)
    first = next(iter(truth.collections.values()))
    pairs, ratios = pairs_of(result), {}
    for pair, (point,) in zip(pairs, propagate(pairs, dataset.sensors, [2.0])):
        source, target = dataset.sensors[pair.source], dataset.sensors[pair.target]
        true = pose(first, truth.graph, target.frame, source.frame)
        at = point.point_in_source_m[None]
        found, right = se3.apply(pair.target_T_source, at), se3.apply(true, at)
        ratio = np.sum((found - right) ** 2) / point.sigma_m**2
        if point.sigma_px is not None:
            off = target.camera.project(found) - target.camera.project(right)
            ratio = np.sum(off**2) / point.sigma_px**2
        ratios[(pair.source, pair.target)] = ratio
    return ratios


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(5, id="5 rigs"),
        pytest.param(100, id="100 rigs", marks=pytest.mark.long),
    ],
)
def runs(request):
    return [run(seed) for seed in range(100, 100 + request.param)]


def granted(off, runs):
    """Return how far a mean over these runs may be off, where over a hundred it may be `off`."""
    return off * np.sqrt(100.0 / len(runs))


@pytest.mark.slow
def test_intervals_cover_the_truth(runs):
    """95 % intervals, pooled over the six components of a sensor."""
    for name in runs[0].errors:
        sigmas = [np.sqrt(np.diagonal(r.covariances[name])) for r in runs]
        inside = [np.abs(r.errors[name]) < 1.96 * s for r, s in zip(runs, sigmas)]
        assert abs(np.mean(inside) - 0.95) <= granted(0.03, runs), (name, np.mean(inside))


@pytest.mark.slow
def test_errors_are_as_large_as_their_covariance_says(runs):
    """NEES: the squared error in units of its covariance, by degree of freedom."""
    for name in runs[0].errors:
        squares = [
            r.errors[name] @ np.linalg.solve(r.covariances[name], r.errors[name]) for r in runs
        ]
        ratio = np.mean(squares) / 6.0
        assert -granted(0.2, runs) <= ratio - 1.0 <= granted(0.3, runs), (name, ratio)


@pytest.mark.slow
def test_planted_sigmas_are_recovered(runs):
    seen = set()
    for name, kind in runs[0].sigmas:
        ratio = np.mean([r.sigmas[(name, kind)] for r in runs if (name, kind) in r.sigmas])
        assert ratio == pytest.approx(1.0, abs=0.1), (name, kind)
        seen.add(name)
    assert len(seen) == 7


@pytest.mark.slow
def test_carried_points_are_as_far_off_as_predicted(runs):
    """Squared displacements over predicted squares, which are 1 on average if all is right.

    From 100 runs the mean is known to 14 % where one direction dominates, and the pairs of a
    target have much in common: pooled, 15 % of the standard deviation are granted. A single pair
    may be off by a factor of 1.4, since the border's sampling is no random error (it errs the
    same way in rows of neighbours): up to 1.28 was measured.
    """
    targets, most = {}, 1.0 + granted(0.4, runs)
    for source, target in runs[0].carried:
        ratio = np.sqrt(np.mean([r.carried[(source, target)] for r in runs]))
        assert 1 / most < ratio < most, (source, target, ratio)
        targets.setdefault(target, []).append(ratio**2)
    for target, ratios in targets.items():
        ratio = np.sqrt(np.mean(ratios))
        assert abs(ratio - 1.0) < granted(0.15, runs), (target, ratio)


def test_the_noise_of_a_sensor_may_be_its_own():
    assert NOISE.of("rgb_1").corner_px == 0.2 and NOISE.of("rgb_2") is NOISE
    scene = paper_cell(0, "train", Noise(sensors={"rgb_1": Noise(corner_px=3.0)}))
    problem = calibrate(scene.dataset)
    rms = {
        b.sensor: np.median(s)
        for b, s in zip(problem.problem.residual_blocks, problem.summary.sigmas)
        if b.modality == RGB
    }
    assert rms["rgb_1"] == pytest.approx(3.0, rel=0.15)
    assert rms["rgb_2"] == pytest.approx(0.3, rel=0.15)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("collections", [5, 7])
def test_few_collections_are_cautious_of_what_they_may_have_in_common(collections):
    """Errors too small to be named; 6.9 sigmas were seen in 12 draws before."""
    for seed in range(3):
        scene = scenes.random_scene(seed, collections=collections, realism=SLIGHT)
        result = calibrate(scene.dataset)
        edges = calibration_results(result, default_solver()).edges
        if result.status == "converged":
            assert max(e.in_sigmas for e in stated_errors(edges, scene.truth)) < 5.0


@pytest.mark.sampled(1)
@pytest.mark.parametrize("collections", [2, 3, 4])
def test_few_collections_are_said_and_no_sigma_rests_on_noise_alone(collections):
    """With 2 and 3 of them and noise alone, 4.0 sigmas were seen among 38 draws before."""
    for seed in range(4):
        scene = scenes.random_scene(seed, collections=collections, disturbance=(0.03, 0.03))
        result = calibrate(scene.dataset)
        assert result.status == "converged"
        said = [w for w in result.warnings if "do not tell by their differences" in w]
        assert len(said) == (collections < 4)
        edges = calibration_results(result, default_solver()).edges
        assert max(error.in_sigmas for error in stated_errors(edges, scene.truth)) < 3.5
        free = [edge for edge in edges if not edge.anchored]
        wider = np.array([edge.sigma / edge.model_sigma for edge in free])
        assert np.all(wider > 1.2) or collections >= 4
