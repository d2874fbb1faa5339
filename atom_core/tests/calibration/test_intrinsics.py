"""Wrong intrinsics: found with their sigmas, the extrinsics right again, held what is not told."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.cli import main
from atom_core.errors import CalibrationError
from atom_core.evaluation.ground_truth import ground_truth_errors
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import (
    intrinsics_names,
    intrinsics_values,
    moved_camera,
    number_scales,
    project_with_derivatives,
)
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.labels import RgbLabel
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import Noise, arm, scenes
from atom_core.synthetic.mistakes import Origin, with_detections_from

K = np.array([[900.0, 0, 640.0], [0, 890.0, 400.0], [0, 0, 1]])
MODELS = {
    "none": [],
    "plumb_bob": [-0.2, 0.05, 0.001, -0.002, 0.01],
    "rational_polynomial": [0.3, -0.1, 0.001, -0.002, 0.01, 0.5, -0.1, 0.02],
    "equidistant": [-0.03, 0.01, -0.004, 0.001],
}
CAMERAS = ("rgb_1", "rgb_2")
DISTURBED = (0.1, 0.1)


def camera(model):
    return Camera(1280, 800, K, MODELS[model], model)


def wrong(true):
    """Return the camera with fx, fy one per cent too long and k1 off."""
    moved = true.K.copy()
    moved[[0, 1], [0, 1]] *= 1.01
    coefficients = true.D.copy()
    coefficients[:1] += 0.05 if true.model != "equidistant" else 0.01
    return Camera(true.width, true.height, moved, coefficients, true.model)


def with_cameras(dataset, change):
    sensors = {
        name: replace(sensor, camera=change(sensor.camera)) if sensor.modality == "rgb" else sensor
        for name, sensor in dataset.sensors.items()
    }
    return replace(dataset, sensors=sensors)


def two_cameras(seed, model="plumb_bob", **options):
    """Return a scene whose dataset has wrong intrinsics, and the true camera."""
    true = camera(model)
    options = {"collections": 25, "disturbance": DISTURBED, **options}
    scene = scenes.two_cameras(seed, camera=true, **options)
    return replace(scene, dataset=with_cameras(scene.dataset, wrong)), true


def found_intrinsics(result, name):
    document = calibration_document(calibration_results(result, "ceres"), {})
    return document["sensors"][name].get("intrinsics", {})


# ------------------------------------------------------------------------------- numbers


@pytest.mark.parametrize("model", MODELS)
def test_derivatives_by_the_numbers_against_central_differences(model):
    start, rng, h = camera(model), np.random.default_rng(0), 1e-6
    numbers = 0.02 * rng.standard_normal(12)
    at = moved_camera(start, numbers)
    pixels = rng.uniform([100, 80], [1180, 720], (60, 2))  # beyond a limit numbers have no say
    points = at.ray_points(pixels, rng.uniform(0.5, 4.0, 60))
    _, _, by_number = project_with_derivatives(start, at, points)
    for i in range(12):
        step = np.zeros(12)
        step[i] = h
        ahead, behind = (moved_camera(start, numbers + s).project(points) for s in (step, -step))
        np.testing.assert_allclose(by_number[:, :, i], (ahead - behind) / (2 * h), atol=1e-5)
    used = len(intrinsics_names(start))
    assert np.all(np.any(by_number[:, :, :used] != 0, axis=(0, 1)))
    assert not np.any(by_number[:, :, used:])


@pytest.mark.parametrize("model", MODELS)
def test_a_number_is_a_displacement_of_the_images_corner(model):
    start = camera(model)
    scales, values = number_scales(start), intrinsics_values(start)
    assert len(scales) == len(values) == len(intrinsics_names(start))
    moved = moved_camera(start, np.full(12, 1e-6))
    changed = (intrinsics_values(moved) - values) / 1e-6
    np.testing.assert_allclose(changed, scales, rtol=1e-4)


# ------------------------------------------------------------------------------- planted


@pytest.mark.sampled(1)
@pytest.mark.parametrize("model", MODELS)
def test_planted_errors_are_found_and_the_extrinsics_are_right_again(model):
    normalised = []
    for seed in range(3):
        scene, true = two_cameras(seed, model)
        result = calibrate(scene.dataset, CalibrationOptions(intrinsics=CAMERAS))
        assert result.status == "converged", result.message
        for name in CAMERAS:
            truth = dict(zip(intrinsics_names(true), intrinsics_values(true)))
            for parameter, entry in found_intrinsics(result, name).items():
                normalised.append((entry["value"] - truth[parameter]) / entry["sigma"])
        errors, held = (
            ground_truth_errors(calibrate(scene.dataset, options).dataset, scene.truth).mean
            for options in (CalibrationOptions(intrinsics=CAMERAS), CalibrationOptions())
        )
        assert errors.translation_m < 0.7 * held.translation_m
        exact = with_cameras(scene.dataset, lambda _, true=true: true)
        sigmas = calibration_document(calibration_results(result, "ceres"), {})["edges"]
        (edge,) = [e for e in sigmas.values() if not e["anchored"]]
        known = ground_truth_errors(calibrate(exact).dataset, scene.truth).mean
        limit = known.translation_m + 4.0 * max(edge["sigma_translation_m"])
        assert errors.translation_m < limit
    pooled = np.array(normalised)
    # k3 and such stay at wrong values nowhere here: what is held is right in these cameras
    assert np.max(np.abs(pooled)) < 4.5
    assert 0.6 < np.sqrt(np.mean(pooled**2)) < 1.5


@pytest.mark.sampled(1)
@pytest.mark.parametrize("expected", [None, 0.01])
def test_sigmas_cover_the_truth(expected):
    covered, squares = [], []
    for seed in range(12):
        scene, true = two_cameras(100 + seed, "none", collections=15)
        # The planted error is twice what is expected by default.
        options = CalibrationOptions(intrinsics=CAMERAS, intrinsics_sigma=expected)
        result = calibrate(scene.dataset, options)
        truth = dict(zip(intrinsics_names(true), intrinsics_values(true)))
        for name in CAMERAS:
            for parameter, entry in found_intrinsics(result, name).items():
                z = (entry["value"] - truth[parameter]) / entry["sigma"]
                covered.append(abs(z) < 1.96)
                squares.append(z * z)
    assert len(covered) == 12 * 8
    assert np.mean(covered) > 0.85 and 0.6 < np.mean(squares) < 1.5


@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_exact_measurements_give_the_exact_cameras(model):
    scene, true = two_cameras(1, model, noise=Noise.none())
    # what is held must be right for this, so only what is told may be wrong
    options = CalibrationOptions(intrinsics=CAMERAS, intrinsics_sigma=None)
    solved = calibrate(scene.dataset, options).dataset
    for name in CAMERAS:
        values = intrinsics_values(solved.sensors[name].camera)
        np.testing.assert_allclose(values, intrinsics_values(true), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("model", ["none", "plumb_bob"])
def test_both_solvers_agree(model):
    scene, _ = two_cameras(2, model)
    found = []
    for name in sorted(SOLVERS):
        options = CalibrationOptions(intrinsics=CAMERAS, solver_name=name)
        dataset = calibrate(scene.dataset, options).dataset
        edges = [dataset.first_value(s.edge)[:3].ravel() for s in dataset.sensors.values()]
        cameras = [
            intrinsics_values(s.camera) / intrinsics_values(s.camera).clip(1.0)
            for s in dataset.sensors.values()
        ]
        found.append(np.concatenate(edges + cameras))
    np.testing.assert_allclose(found[0], found[-1], atol=1e-6)


def test_range_sensors_stay_beside_cameras_that_move():
    scene = scenes.random_scene(1, collections=20, disturbance=DISTURBED)
    dataset = with_cameras(scene.dataset, wrong)
    before = calibrate(dataset)
    result = calibrate(dataset, CalibrationOptions(intrinsics=CAMERAS))
    assert result.status == "converged", result.message
    errors = [ground_truth_errors(r.dataset, scene.truth).mean for r in (before, result)]
    assert errors[1].translation_m < 0.5 * errors[0].translation_m
    depth = scene.dataset.sensors["depth_1"].camera
    assert np.array_equal(result.dataset.sensors["depth_1"].camera.K, depth.K)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "options",
    [
        {"initial_guess": "none"},
        {"noisy_initial_guess": (0.4, 0.4), "seed": 1},
        {"range_offset": ("lidar_1",)},
        {"anchor_sensors": CAMERAS},
    ],
    ids=str,
)
def test_with_other_options_at_once(options):
    scene = scenes.random_scene(1, collections=20, disturbance=(0.0, 0.0))
    dataset = with_cameras(scene.dataset, wrong)
    result = calibrate(dataset, CalibrationOptions(intrinsics=CAMERAS, **options))
    assert result.status == "converged", result.message
    for name in CAMERAS:
        fx = scene.dataset.sensors[name].camera.K[0, 0]
        found = found_intrinsics(result, name)["fx"]
        assert abs(found["value"] - fx) < 4.5 * found["sigma"] < 20.0


def test_with_atoms_weights_too():
    scene = scenes.random_scene(1, collections=20)
    solver = SolverOptions(weights="atom", loss="none")
    dataset = with_cameras(scene.dataset, wrong)
    result = calibrate(dataset, CalibrationOptions(intrinsics=CAMERAS, solver=solver))
    # its weights lose so much that the distortion is hardly told, and that is said
    assert result.status in ("converged", "rank_deficient")
    fx = scene.dataset.sensors["rgb_2"].camera.K[0, 0]
    found = found_intrinsics(result, "rgb_2")["fx"]
    assert abs(found["value"] - fx) < 4.5 * found["sigma"]


def test_with_joints_at_once():
    errors = {"elbow": {"position_bias": 0.02}}
    scene = arm.camera_on_arm(0, errors=errors, collections=25, disturbance=DISTURBED)
    true = scene.dataset.sensors["rgb_1"].camera
    dataset = with_cameras(scene.dataset, wrong)
    result = calibrate(dataset, CalibrationOptions(intrinsics=("rgb_1",)))
    assert result.status == "converged", result.message
    bias = result.dataset.joint("elbow").parameters["position_bias"]
    assert bias == pytest.approx(0.02, abs=2e-3)
    assert result.dataset.sensors["rgb_1"].camera.K[0, 0] == pytest.approx(true.K[0, 0], rel=3e-3)


def test_bad_detections_are_found_among_wrong_intrinsics():
    scene, true = two_cameras(3, "plumb_bob")
    keys = [{k.collection for k, _ in scene.dataset.detections() if k.sensor == n} for n in CAMERAS]
    both = sorted(set.intersection(*keys))
    victim, donor = both[2], both[7]
    bad = with_detections_from(scene.dataset, {(victim, "rgb_2"): Origin(scene.dataset, donor)})
    result = calibrate(bad, CalibrationOptions(intrinsics=CAMERAS))
    assert {r.key.collection for r in result.rejected} == {victim}
    fx = result.dataset.sensors["rgb_2"].camera.K[0, 0]
    assert fx == pytest.approx(true.K[0, 0], rel=6e-3)


# --------------------------------------------------------------------------------- told


def test_what_the_corners_do_not_tell_is_held_and_said():
    scene, true = two_cameras(0, "rational_polynomial")
    result = calibrate(scene.dataset, CalibrationOptions(intrinsics=("rgb_1",)))
    found = found_intrinsics(result, "rgb_1")
    held = [name for name in intrinsics_names(true) if name not in found]
    assert {"k4", "k5", "k6"} <= set(held) and {"fx", "fy", "cx", "cy"} <= set(found)
    (remark,) = [w for w in result.warnings if w.startswith("camera 'rgb_1'")]
    assert ", ".join(held) + " are held" in remark and "of the way" in remark
    now = result.dataset.sensors["rgb_1"].camera
    before = dict(
        zip(intrinsics_names(now), intrinsics_values(scene.dataset.sensors["rgb_1"].camera))
    )
    for name, value in zip(intrinsics_names(now), intrinsics_values(now)):
        assert (value == before[name]) == (name in held)
    assert found_intrinsics(result, "rgb_2") == {}


def test_boards_looked_at_squarely_leave_the_focal_length_open():
    rng = np.random.default_rng(0)
    scene = arm.camera_on_arm(0, errors={}, collections=3)
    dataset = scene.dataset
    sensor, pattern = dataset.sensors["rgb_1"], dataset.patterns["pattern_1"]
    collections = {}
    ids = np.arange(pattern.corner_count)
    for key, collection in dataset.collections.items():
        pose = np.eye(4)
        pose[:3, 3] = [*rng.uniform(-0.05, 0.05, 2), 1.2]  # all at one distance
        points = pattern.corners_of(ids) @ pose[:3, :3].T + pose[:3, 3] - [0.25, 0.2, 0]
        pixels = sensor.camera.project(points) + rng.normal(0.0, 0.2, (len(ids), 2))
        label = RgbLabel(ids, pixels)
        collections[key] = replace(collection, labels={("rgb_1", "pattern_1"): label})
    loose = replace(pattern, fixed=False)
    config = replace(
        dataset.config,
        calibration_patterns={
            "pattern_1": replace(dataset.config.calibration_patterns["pattern_1"], fixed=False)
        },
    )
    flat = replace(dataset, collections=collections, patterns={"pattern_1": loose}, config=config)
    twin = with_twin(flat)
    options = CalibrationOptions(intrinsics=("rgb_1",), intrinsics_sigma=None)
    result = calibrate(twin, options)
    assert result.status == "rank_deficient"
    named = {name for weak in result.weak_directions for name in weak.parameters}
    assert {"rgb_1 fx", "rgb_1 fy"} <= named
    assert any("rgb_1 looks squarely at all boards" in w.why for w in result.weak_directions)
    bounded = calibrate(twin, replace(options, intrinsics_sigma=0.005))
    assert any("rgb_1': fx, fy, cx, cy stay near what is given" in w for w in bounded.warnings)
    given = sensor.camera.focal_px[0]
    focal = found_intrinsics(bounded, "rgb_1")["fx"]
    assert abs(focal["value"] - given) < 0.005 * given
    assert focal["sigma"] == pytest.approx(0.005 * given, rel=0.5)


@pytest.mark.parametrize("solver", ["ceres", "scipy"])
def test_what_is_expected_is_weighed_with_what_the_corners_tell(solver):
    """Between the two, by their variances; about the given cameras, also when solved again."""
    scene, _ = two_cameras(100, "none", collections=15)
    found = {}
    for sigma in (None, 0.01, 0.001, 1e-6):
        options = CalibrationOptions(solver_name=solver, intrinsics=CAMERAS)
        result = calibrate(scene.dataset, replace(options, intrinsics_sigma=sigma))
        found[sigma] = found_intrinsics(result, "rgb_1")["fx"]
    given = scene.dataset.sensors["rgb_1"].camera.focal_px[0]
    assert abs(found[1e-6]["value"] - given) < 0.01
    assert found[1e-6]["sigma"] == pytest.approx(1e-6 * given, rel=0.05)
    away = [abs(found[sigma]["value"] - given) for sigma in (None, 0.01, 0.001, 1e-6)]
    assert away == sorted(away, reverse=True)
    free, weak = found[None], found[0.01]
    assert weak["sigma"] < free["sigma"]


def test_open_intrinsics_are_told_in_their_unit():
    scene, _ = two_cameras(0, "none")
    options = CalibrationOptions(intrinsics=("rgb_1",), undetermined_limit=(10.0, 2e-4))
    result = calibrate(scene.dataset, options)
    sigmas = found_intrinsics(result, "rgb_1")
    led = [weak for weak in result.weak_directions if weak.unit == "px"]
    assert led and all("change" in weak.why for weak in led)
    assert all(any(name.startswith("rgb_1 ") for name in weak.parameters) for weak in led)
    assert 0.2 * sigmas["fx"]["sigma"] < led[0].sigma < 1.2 * sigmas["fx"]["sigma"]


def with_twin(dataset):
    """Return the dataset with a second camera that sees the same, so that boards tie the two."""
    sensor = dataset.sensors["rgb_1"]
    edge = sensor.edge._replace(child="twin_link")
    twin = replace(sensor, name="rgb_2", edge=edge, frame="twin_link")
    first = sensor.edge
    collections, rng = {}, np.random.default_rng(1)
    for key, collection in dataset.collections.items():
        below = {e.parent: m for e, m in collection.transforms.items()}
        optical = collection.transforms[first] @ below["rgb_1_link"] @ below["rgb_1_frame"]
        labels = dict(collection.labels)
        label = labels[("rgb_1", "pattern_1")]
        pixels = label.pixels + rng.normal(0.0, 0.01, label.pixels.shape)
        labels[("rgb_2", "pattern_1")] = replace(label, pixels=pixels)
        collections[key] = replace(
            collection, labels=labels, transforms={**collection.transforms, edge: optical}
        )
    config = replace(
        dataset.config,
        anchored_sensor="rgb_2",
        sensors={
            **dataset.config.sensors,
            "rgb_2": replace(
                dataset.config.sensors["rgb_1"], link="twin_link", child_link="twin_link"
            ),
        },
    )
    return replace(
        dataset, sensors={"rgb_1": sensor, "rgb_2": twin}, collections=collections, config=config
    )


# --------------------------------------------------------------------------------- files


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("intrinsics")
    scene, true = two_cameras(1)
    path = write_dataset_folder(scene.dataset, folder / "data", name="train")
    out = folder / "out"
    assert main(["calibrate", "-json", str(path), "--output", str(out), "-oi"]) == 0
    return path, out, true


def test_the_cameras_are_written(files, capsys):
    path, out, true = files
    document = json.loads((out / "calibration.json").read_text())
    written = read_dataset(out / "atom_calibration.json")
    raw = json.loads((out / "atom_calibration.json").read_text())["sensors"]
    before = json.loads(path.read_text())["sensors"]
    for name in CAMERAS:
        found, now = document["sensors"][name]["intrinsics"], written.sensors[name].camera
        assert found["fx"]["value"] == now.K[0, 0] == raw[name]["camera_info"]["P"][0]
        assert found["fx"]["change"] == pytest.approx(-9.0, abs=4.0)
        assert abs(found["k1"]["value"] - true.D[0]) < 5 * found["k1"]["sigma"]
        assert found["k1"]["value"] == raw[name]["camera_info"]["D"][0]
        assert found["cx"]["unit"] == "px" and found["k1"]["unit"] == "1"
        same = set(before[name]["camera_info"]) - {"K", "D", "P"}
        assert all(before[name]["camera_info"][k] == raw[name]["camera_info"][k] for k in same)


def test_options_name_cameras(files, tmp_path, capsys):
    path, _, _ = files
    common = ["calibrate", "-json", str(path), "--output"]
    assert main([*common, str(tmp_path / "a"), "--optimize-intrinsics", "rgb_2"]) == 0
    assert "Calibrated intrinsics" in capsys.readouterr().out
    document = json.loads((tmp_path / "a" / "calibration.json").read_text())
    assert [n for n, s in document["sensors"].items() if "intrinsics" in s] == ["rgb_2"]
    assert main([*common, str(tmp_path / "b"), "-oi", "rgb_9"]) == 2
    assert "no rgb camera matches 'rgb_9'" in capsys.readouterr().err


def test_only_rgb_cameras_have_intrinsics_to_estimate():
    dataset = scenes.random_scene(0, collections=4).dataset
    with pytest.raises(CalibrationError, match="--optimize_intrinsics depth_1: there is no such"):
        calibrate(dataset, CalibrationOptions(intrinsics=("depth_1",)))


def test_a_dataset_without_changes_keeps_its_camera_info(files):
    path, out, _ = files
    assert main(["calibrate", "-json", str(path), "--output", str(out.parent / "held")]) in (0, 1)
    held = json.loads((out.parent / "held" / "atom_calibration.json").read_text())
    assert held["sensors"] == json.loads(path.read_text())["sensors"]
