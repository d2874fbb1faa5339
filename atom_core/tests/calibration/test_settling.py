"""Sigmas that do not settle are bounded by what the detections say by themselves."""

import cv2
import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import pose
from atom_core.solvers.base import SolverOptions
from atom_core.synthetic import paper_cell

LEFT, RIGHT = "top_left_camera", "top_right_camera"
STEREO = cv2.CALIB_FIX_INTRINSIC


def sigmas_of(result):
    blocks = result.problem.residual_blocks
    return {(b.sensor, b.kind): np.median(s) for b, s in zip(blocks, result.summary.sigmas)}


def test_after_few_rounds_a_healthy_cell_has_the_same_answer():
    """Nothing is left beyond the noise of the labels, which the free fits know."""
    scene = paper_cell(0, disturbance=(0.05, 0.05))
    whole = calibrate(scene.dataset)
    hasty = calibrate(scene.dataset, CalibrationOptions(solver=SolverOptions(reweighting_rounds=3)))
    assert whole.summary.settled and not any("scatters" in w for w in whole.warnings)
    assert hasty.status == "converged" and any("scatters" in w for w in hasty.warnings)
    expected, found = sigmas_of(whole), sigmas_of(hasty)
    for key, sigma in expected.items():
        assert found[key] == pytest.approx(sigma, rel=0.1), key
    for edge in scene.truth.edges:
        one, two = (r.dataset.first_value(edge) for r in (whole, hasty))
        assert np.linalg.norm(one[:3, 3] - two[:3, 3]) < 0.0005


def test_sensors_that_agree_are_not_said_to_contradict_each_other():
    """Three collections are few to tell each sensor's scatter, and no reason to doubt a lens."""
    scene = paper_cell(0, disturbance=(0.05, 0.05))
    few = calibrate(scene.dataset, CalibrationOptions(solver=SolverOptions(reweighting_rounds=3)))
    (told,) = [w for w in few.warnings if "do not settle" in w]
    assert "contradict" not in told and "intrinsics" not in told and "agree" in told


# ------------------------------------------------------------------- two real cameras, one board


@pytest.fixture(scope="module")
def atlascar(real_data):
    """Return the two cameras of a dataset of ATOM's earliest format."""
    dataset = read_dataset(real_data("atlascar") / "data_collected.json")
    return dataset.selected(sensors=(LEFT, RIGHT))


def opencv_right_T_left(dataset):
    """Return OpenCV's answer with the given intrinsics, (4, 4)."""
    cameras = [dataset.sensors[name].camera for name in (LEFT, RIGHT)]
    pixels, corners = {LEFT: [], RIGHT: []}, []
    for collection in dataset.collections.values():
        for name, of_camera in pixels.items():
            label = collection.labels[(name, "pattern_1")]
            of_camera.append(label.pixels.astype(np.float32)[:, None])
        corners.append(dataset.patterns["pattern_1"].corners_of(label.ids).astype(np.float32))
    matrices = [m.copy() for camera in cameras for m in (camera.K, camera.D)]
    found = cv2.stereoCalibrate(
        *(corners, pixels[LEFT], pixels[RIGHT], *matrices, (964, 724)),
        flags=STEREO,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12),
    )
    assert found[0] == pytest.approx(0.5106, abs=1e-3)  # the published RMS
    return se3.transform(found[5], found[6].ravel())


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", ["ceres", "scipy"])
def test_two_real_cameras_settle_where_opencv_has_them(atlascar, solver):
    result = calibrate(atlascar, CalibrationOptions(solver_name=solver))
    assert result.summary.settled and result.summary.status == "converged"
    (told,) = [w for w in result.warnings if "do not settle" in w]
    assert RIGHT in told and "the cameras contradict the rest, look at their intrinsics" in told
    assert not result.rejected
    dataset = result.dataset
    collection = next(iter(dataset.collections.values()))
    left, right = (
        pose(collection, dataset.graph, dataset.world, dataset.sensors[name].frame)
        for name in (LEFT, RIGHT)
    )
    edge = dataset.sensors[RIGHT].edge
    found = dataset.first_value(edge)
    wanted = left @ se3.inverse(opencv_right_T_left(atlascar)) @ se3.inverse(right) @ found
    shift = found[:3, 3] - wanted[:3, 3]
    turn = se3.rotation_vector_from_rotation(found[:3, :3] @ wanted[:3, :3].T)
    assert np.linalg.norm(shift) < 0.001 and np.linalg.norm(turn) < np.radians(0.05)
    block = [b.edge for b in result.problem.parameters.blocks].index(edge)
    sigmas = np.sqrt(np.diag(result.covariance.block(block)))
    assert np.all(np.abs(np.concatenate([turn, shift])) < 2.0 * sigmas)
    assert np.all(sigmas[3:] < 0.01)  # and they say something


def test_with_the_2d_lidars_it_settles_too_and_says_what_contradicts(real_data):
    """The rounds used up all iterations: that was given as the reason, without a remedy."""
    dataset = read_dataset(real_data("atlascar") / "data_collected.json")
    result = calibrate(dataset)
    assert result.summary.settled and result.status == "inconsistent"
    assert any("do not settle" in w for w in result.warnings)
    assert "iterations" not in result.message
