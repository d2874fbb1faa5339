"""Each planted error appears in the measurements with its size, and in nothing else."""

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.dataset import pose, range_points
from atom_core.model.labels import RgbLabel
from atom_core.model.sensor import DEPTH, LIDAR2D, LIDAR3D, RGB
from atom_core.model.transforms import Edge
from atom_core.model.truth import with_truth
from atom_core.synthetic import PLAIN, ROUGH, Noise, Planted, Sampling, paper_cell, scenes
from atom_core.synthetic.board import board_hits, border_points, is_dark
from atom_core.synthetic.cell import cell_rig
from atom_core.synthetic.planted import BoardErrors, RangeErrors, SensorErrors
from atom_core.synthetic.scanners import cell_with_scanners
from atom_core.synthetic.scenes import random_rig
from atom_core.synthetic.sensing import planted_in

EXACT, USUAL = Noise.none(), Sampling()
BORDER = Sampling(exact_border=True)


@lru_cache(maxsize=None)
def scene(collections=4, noise=EXACT, sampling=USUAL, make=scenes.random_scene, **errors):
    """Return a scene with some errors planted; tests share it."""
    realism = replace(PLAIN, **errors)
    return make(2, collections=collections, noise=noise, sampling=sampling, realism=realism)


def detections(synthetic, modality):
    """Yield (key, label, sensor, true pattern, sensor_T_pattern) at the truth."""
    dataset = with_truth(synthetic.dataset, synthetic.truth)
    for key, label in dataset.detections():
        sensor, pattern = dataset.sensors[key.sensor], dataset.patterns[key.pattern]
        if sensor.modality == modality:
            collection = dataset.collections[key.collection]
            sensor_T_pattern = pose(collection, dataset.graph, sensor.frame, pattern.frame)
            config = dataset.config.calibration_patterns[key.pattern]
            true = synthetic.planted.of_board(key.pattern).true_pattern(key.pattern, config)
            yield key, label, sensor, true, sensor_T_pattern


def points_in_pattern(synthetic, modality, limit=False):
    """Yield (true pattern, labeled points (n, 3) in its frame) of each detection."""
    for key, _, _, pattern, sensor_T_pattern in detections(synthetic, modality):
        points = range_points(synthetic.dataset, key)
        chosen = points.limit if limit else points.inside
        yield pattern, se3.apply(se3.inverse(sensor_T_pattern), chosen)


def range_errors(synthetic, modality=LIDAR3D):
    """Return name, measured minus true range, true range, ring and darkness of all returns."""
    rows = []
    for key, _, sensor, pattern, sensor_T_pattern in detections(synthetic, modality):
        points = range_points(synthetic.dataset, key).inside
        ranges = np.linalg.norm(points, axis=1)
        along = points / ranges[:, None]
        true, in_plane = board_hits(sensor_T_pattern, pattern, along)
        rings = np.rint((np.degrees(np.arcsin(along[:, 2])) + 15.0) / 2.0).astype(int)
        dark = is_dark(sensor_T_pattern, pattern, in_plane)
        names = np.full(len(points), sensor.name)
        rows.append((names, ranges - true, true, rings, dark))
    return [np.concatenate(column) for column in zip(*rows)]


def corners_on_board(synthetic):
    """Return (n, 2) corners, found where their rays meet the board, and their nominal places."""
    found, nominal = [], []
    for key, label, sensor, pattern, camera_T_pattern in detections(synthetic, RGB):
        true = synthetic.planted.of(sensor.name).true_sensor(sensor)
        rays = np.column_stack([true.camera.normalise(label.pixels), np.ones(len(label.ids))])
        found.append(board_hits(camera_T_pattern, pattern, rays)[1])
        nominal.append(synthetic.dataset.patterns[key.pattern].corners_by_id[label.ids])
    return np.concatenate(found), np.concatenate(nominal)


def arrays(dataset):
    yield from (c.transforms[e] for c in dataset.collections.values() for e in c.transforms)
    for key, label in dataset.detections():
        yield from vars(label).values()
        if not isinstance(label, RgbLabel):
            yield range_points(dataset, key).inside


# ----------------------------------------------------------------------------------- ranges


def test_every_lidar_reads_long_by_the_offset_planted():
    _, errors, *_ = range_errors(scene(lidar_offset_m=0.015))
    assert len(errors) > 500
    np.testing.assert_allclose(errors, 0.015, atol=1e-9)


def test_every_lidar_reads_long_by_a_share_of_the_range():
    _, errors, true, *_ = range_errors(scene(lidar_scale=0.005))
    np.testing.assert_allclose(errors / true, 0.005, atol=1e-9)


def test_offsets_are_each_lidars_own():
    synthetic = scene(make=scenes.lidar_only, lidar_offset_sigma_m=0.015)
    names, errors, *_ = range_errors(synthetic)
    planted = {name: synthetic.planted.of(name).offset_m for name in np.unique(names)}
    assert len(set(planted.values())) == 3
    for name, offset in planted.items():
        np.testing.assert_allclose(errors[names == name], offset, atol=1e-9)


def test_every_layer_reads_long_by_its_own_amount():
    synthetic = scene(ring_offset_sigma_m=0.004)
    _, errors, _, rings, _ = range_errors(synthetic)
    planted = np.array(synthetic.planted.of("lidar_1").ring_offsets_m)
    assert len(np.unique(rings)) >= 5
    np.testing.assert_allclose(errors, planted[rings], atol=1e-9)


def test_dark_squares_read_longer():
    _, errors, _, _, dark = range_errors(scene(dark_offset_m=0.005))
    assert 0.2 < np.mean(dark) < 0.6
    np.testing.assert_allclose(errors, 0.005 * dark, atol=1e-9)


def test_returns_of_dark_squares_are_lost():
    before, after = (range_errors(scene(10, dark_lost=lost))[4] for lost in (0.0, 0.1))
    assert np.sum(~after) == np.sum(~before)
    assert np.sum(after) / np.sum(before) == pytest.approx(0.9, abs=0.03)


def test_wide_beams_are_mixed_at_the_border():
    """The room is metres behind: only beams that lie on the board by 97 % are taken for it."""
    synthetic = scene(beam_divergence_rad=0.003)
    for pattern, limit in points_in_pattern(synthetic, LIDAR3D, limit=True):
        inside = -pattern.border.signed_distance(limit[:, :2])[0]
        assert np.min(inside) > 0.001  # seen under an angle; 1.5 mrad of 2 m are 3 mm
    mixed = []
    for key, label, _, pattern, sensor_T_pattern in detections(synthetic, LIDAR3D):
        cloud = synthetic.dataset.data.read(key.collection, key.sensor)
        ranges = np.linalg.norm(cloud, axis=1)
        true, _ = board_hits(sensor_T_pattern, pattern, cloud / ranges[:, None])
        met = np.isfinite(true)
        assert np.min((ranges - true)[met]) > -1e-9
        assert np.max((ranges - true)[label.indices]) < 0.03
        others = np.setdiff1d(np.flatnonzero(met), label.indices)
        mixed.append((ranges - true)[others])
    mixed = np.concatenate(mixed)
    assert len(mixed) > 20 and np.min(mixed) >= 0.03
    for narrow, wide in zip(*(points_in_pattern(s, LIDAR3D) for s in (scene(), synthetic))):
        assert 0.85 * len(narrow[1]) < len(wide[1]) < len(narrow[1])


@pytest.mark.long
def test_2d_lidars_have_offsets_and_dark_squares():
    realism = replace(PLAIN, lidar_offset_m=0.01, lidar_scale=0.002, dark_offset_m=0.005)
    synthetic = cell_with_scanners(0, noise=EXACT, realism=realism)
    _, errors, true, _, dark = range_errors(synthetic, LIDAR2D)
    assert len(errors) > 300 and np.any(dark)
    np.testing.assert_allclose(errors, 0.01 + 0.002 * true + 0.005 * dark, atol=1e-9)
    lossy = cell_with_scanners(0, noise=EXACT, realism=replace(PLAIN, dark_lost=0.5))
    assert np.mean(range_errors(lossy, LIDAR2D)[4]) < 0.75 * np.mean(dark)


# ------------------------------------------------------------------------------------ depth


def depth_errors(synthetic):
    """Return the errors along z (n,), true depths (n,) and pixels (n,) of labeled pixels."""
    rows = []
    for key, label, _, pattern, sensor_T_pattern in detections(synthetic, DEPTH):
        points = range_points(synthetic.dataset, key).inside
        true = board_hits(sensor_T_pattern, pattern, points / points[:, 2:])[0]
        rows.append((points[:, 2] - true, true, label.indices))
    return [np.concatenate(column) for column in zip(*rows)]


def test_depths_are_too_far_by_a_share():
    errors, true, _ = depth_errors(scene(depth_scale=0.01))
    assert len(errors) > 500
    np.testing.assert_allclose(errors / true, 0.01, atol=1e-9)


def test_waves_go_across_the_depth_image():
    synthetic = scene(10, depth_wave_m=0.004, depth_wave_share=0.003)
    errors, true, pixels = depth_errors(synthetic)
    share = errors / (0.004 + 0.003 * true)
    assert 0.97 < np.max(share) <= 1.0 + 1e-9 and -1.0 - 1e-9 <= np.min(share) < -0.97
    assert abs(np.mean(share)) < 0.3
    (across, down), phase = (
        synthetic.planted.of("depth_1").wave_per_px,
        synthetic.planted.of("depth_1").wave_phase_rad,
    )
    assert 0.25 * 640 <= 2 * np.pi / np.hypot(across, down) <= 0.5 * 640
    row, column = np.divmod(pixels, 640)
    np.testing.assert_allclose(share, np.sin(phase + across * column + down * row), atol=1e-6)


def test_holes_surround_jumps_of_the_depth():
    synthetic = scene(depth_halo_px=2)
    for key, label, sensor, pattern, camera_T_pattern in detections(synthetic, DEPTH):
        outline = se3.apply(camera_T_pattern, border_points(pattern, 0.005))
        row, column = np.divmod(label.limit_indices, 640)
        pixels = np.column_stack([column, row])
        away = pixels[:, None] - sensor.camera.project(outline)[None]
        nearest = np.min(np.linalg.norm(away, axis=2), axis=1)
        assert np.min(nearest) > 1.4 and np.median(nearest) == pytest.approx(2.5, abs=0.4)
        image = synthetic.dataset.data.read(key.collection, key.sensor)
        seen = np.rint(sensor.camera.project(outline)).astype(int)
        seen = seen[np.all((seen >= 1) & (seen < [639, 479]), axis=1)]
        assert np.all(np.isnan(image[seen[:, 1], seen[:, 0]]))
        whole = scene().dataset.data.read(key.collection, key.sensor)
        assert 0.001 < np.mean(np.isnan(image) & ~np.isnan(whole)) < 0.05


# ---------------------------------------------------------------------------------- cameras


def test_a_longer_focal_length_spreads_the_corners():
    synthetic, exact = (scene(focal_scale=share) for share in (0.005, 0.0))
    spread = []
    for one, two in zip(detections(synthetic, RGB), detections(exact, RGB)):
        centre = one[2].camera.centre_px
        _, mine, theirs = np.intersect1d(one[1].ids, two[1].ids, return_indices=True)
        wide, right = (label.pixels for label in (one[1], two[1]))
        spread.append(((wide[mine] - centre) / (right[theirs] - centre)).ravel())
    np.testing.assert_allclose(np.concatenate(spread), 1.005, atol=1e-9)


def test_intrinsics_are_each_cameras_own():
    synthetic = scene(focal_sigma=0.002, centre_sigma=0.002)
    found, nominal = corners_on_board(synthetic)
    np.testing.assert_allclose(found, nominal, atol=1e-8)
    one, two = (synthetic.planted.of(name) for name in ("rgb_1", "rgb_2"))
    assert one.focal_scale != two.focal_scale and one.centre_px != two.centre_px
    given = synthetic.dataset.sensors["rgb_1"].camera.K
    assert np.array_equal(given, scene().dataset.sensors["rgb_1"].camera.K)


@pytest.mark.slow
def test_blur_and_vignetting_leave_corners_where_they_are():
    """Why these two do nothing to the labels of synthetic scenes: found in rendered pictures."""
    dataset = scene().dataset
    rng, found = np.random.default_rng(0), {}
    for key, label, sensor, _, _ in detections(scene(), RGB):
        pattern, config = dataset.patterns["pattern_1"], dataset.config.calibration_patterns
        labeler = RgbLabeler(sensor, pattern, config["pattern_1"])
        picture = dataset.data.read(key.collection, key.sensor).astype(np.float32)
        row, column = np.mgrid[-1 : 1 : 1j * picture.shape[0], -1 : 1 : 1j * picture.shape[1]]
        shade = 1.0 - ROUGH.vignetting * (row**2 + column**2)[..., None] / 2.0
        for name, seen in (
            ("plain", picture),
            ("rough", shade * cv2.GaussianBlur(picture, (0, 0), ROUGH.blur_px)),
        ):
            noisy = np.clip(seen + 2.0 * rng.standard_normal(seen.shape), 0, 255)
            corners = labeler.label(np.rint(noisy).astype(np.uint8)).label
            _, mine, true = np.intersect1d(corners.ids, label.ids, return_indices=True)
            found.setdefault(name, []).append(corners.pixels[mine] - label.pixels[true])
    plain, rough = (np.concatenate(found[name]) for name in ("plain", "rough"))
    assert len(rough) > 0.97 * len(plain)
    assert np.sqrt(np.mean(rough**2)) < 1.2 * np.sqrt(np.mean(plain**2)) < 0.06
    assert np.max(np.abs(np.mean(rough, axis=0))) < 0.01


# ----------------------------------------------------------------------------------- boards


def test_a_larger_board_has_larger_squares_and_a_larger_plate():
    synthetic = scene(sampling=BORDER, board_scale=0.005)
    found, nominal = corners_on_board(synthetic)
    np.testing.assert_allclose(found, 1.005 * nominal, atol=1e-8)
    nominal = synthetic.dataset.patterns["pattern_1"].border
    for pattern, limit in points_in_pattern(synthetic, LIDAR3D, limit=True):
        np.testing.assert_allclose(pattern.border.corners, 1.005 * nominal.corners)
        assert np.max(np.abs(pattern.border.signed_distance(limit[:, :2])[0])) < 1e-9


def test_a_print_off_the_centre_moves_the_border_against_it():
    synthetic = scene(sampling=BORDER, print_shift_m=(0.010, 0.0))
    found, nominal = corners_on_board(synthetic)
    np.testing.assert_allclose(found, nominal, atol=1e-8)
    border = synthetic.dataset.patterns["pattern_1"].border
    for _, limit in points_in_pattern(synthetic, LIDAR3D, limit=True):
        assert np.max(np.abs(border.signed_distance(limit[:, :2] + [0.01, 0.0])[0])) < 1e-9


@pytest.mark.parametrize("modality", [LIDAR3D, DEPTH])
def test_a_bent_board_has_its_sagitta(modality):
    heights, across = [], []
    for pattern, points in points_in_pattern(scene(bend_m=0.002), modality):
        heights.append(points[:, 2])
        across.append((points[:, 0] - pattern.border.centre[0]) / pattern.border.half_size[0])
    height, u = np.concatenate(heights), np.concatenate(across)
    assert np.max(height) - np.min(height) == pytest.approx(0.002, rel=0.05)
    assert abs(np.mean(height)) < 0.0002
    np.testing.assert_allclose(height, 0.002 * (u**2 - 1.0 / 3.0), atol=1e-7)


@pytest.mark.parametrize("modality", [LIDAR3D, DEPTH])
def test_the_back_of_a_thick_board_lies_behind_its_print(modality):
    def heights(bearing_rad):
        realism = replace(PLAIN, thickness_m=0.018)
        options = {"noise": EXACT, "modality": modality, "collections": 4}
        synthetic = scenes.from_behind(0, bearing_rad=bearing_rad, realism=realism, **options)
        return np.concatenate([p[:, 2] for _, p in points_in_pattern(synthetic, modality)])

    np.testing.assert_allclose(heights(3.0), 0.018, atol=1e-7)
    np.testing.assert_allclose(heights(0.0), 0.0, atol=1e-7)


def test_cameras_see_the_bend():
    pixels, flat = [], []
    for _, label, sensor, pattern, camera_T_pattern in detections(scene(bend_m=0.02), RGB):
        pixels.append(label.pixels)
        u = (pattern.corners_by_id[label.ids, 0] - pattern.border.centre[0]) / 0.4
        corners = np.column_stack([pattern.corners_by_id[label.ids], 0.02 * (u**2 - 1.0 / 3.0)])
        flat.append(sensor.camera.project(se3.apply(camera_T_pattern, corners)))
    np.testing.assert_allclose(np.concatenate(pixels), np.concatenate(flat), atol=1e-6)


# ----------------------------------------------------------------------------- moving edges


@pytest.mark.parametrize("make", [scenes.hand_eye, scenes.board_on_arm])
def test_moving_transforms_are_off_and_the_true_ones_are_told(make):
    sigmas = {"moving_edge_sigma_m": 0.001, "moving_edge_sigma_rad": 0.002}
    synthetic, exact = scene(40, make=make, **sigmas), scene(40, make=make)
    (edge,) = {edge for edge, _ in synthetic.planted.moving}
    assert edge == Edge("rig_base", "flange")
    shifts, turns = [], []
    for key, collection in synthetic.dataset.collections.items():
        true = synthetic.planted.moving[(edge, key)]
        assert np.array_equal(true, exact.dataset.collections[key].transforms[edge])
        off = se3.inverse(true) @ collection.transforms[edge]
        shifts.append(off[:3, 3])
        turns.append(se3.rotation_vector_from_rotation(off[:3, :3]))
    assert np.std(shifts) == pytest.approx(0.001, rel=0.2)
    assert np.std(turns) == pytest.approx(0.002, rel=0.2)
    same = (np.array_equal(a[1].pixels, b[1].pixels) for a, b in _pairs(synthetic, exact))
    assert all(same)


def _pairs(one, two):
    pairs = list(zip(one.dataset.detections(), two.dataset.detections()))
    assert len(pairs) > 30
    return pairs


# ------------------------------------------------------------------------------ what is drawn


def test_errors_of_no_size_change_nothing():
    none = paper_cell(1, realism=replace(PLAIN, sensors=("rgb_1",), vignetting=0.5))
    compared = 0
    for a, b in zip(arrays(paper_cell(1).dataset), arrays(none.dataset)):
        np.testing.assert_array_equal(a, b)
        compared += 1
    assert compared > 200
    assert none.planted.of("lidar_1") == SensorErrors()
    assert paper_cell(1).planted == Planted()


@pytest.mark.long
def test_train_and_test_set_of_a_seed_share_what_is_planted():
    train, test, other = (
        paper_cell(seed, scenario, realism=ROUGH).planted
        for seed, scenario in ((4, "train"), (4, "test"), (5, "train"))
    )
    assert train == test and train.sensors != other.sensors
    assert set(train.sensors) == set(cell_rig(4).sensors)


def test_an_error_planted_alone_is_as_large_as_among_others():
    rig = cell_rig(0)
    alone = planted_in(rig, ["pattern_1"], replace(PLAIN, lidar_offset_sigma_m=0.015), [0])
    rough = planted_in(rig, ["pattern_1"], ROUGH, [0])
    for name in ("lidar_1", "lidar_2", "lidar_3"):
        assert alone.of(name) == RangeErrors(rough.of(name).offset_m, ring_offsets_m=(0.0,) * 16)
    assert alone.of_board("pattern_1") == BoardErrors()


def test_only_the_sensors_asked_for_have_errors():
    realism = replace(PLAIN, lidar_offset_m=0.03, sensors=("lidar_2",))
    planted = planted_in(cell_rig(0), ["pattern_1"], realism, [0])
    assert planted.of("lidar_2").offset_m == 0.03
    assert list(planted.sensors) == ["lidar_2"]


def test_what_is_drawn_has_the_sizes_of_the_rough_profile():
    rig = random_rig(np.random.default_rng(0), 2, 1, 3)
    drawn = [planted_in(rig, ["pattern_1"], ROUGH, [seed]) for seed in range(300)]
    lidars = [planted.of(f"lidar_{i}") for planted in drawn for i in (1, 2, 3)]
    assert np.std([lidar.offset_m for lidar in lidars]) == pytest.approx(0.015, rel=0.1)
    assert np.std([lidar.ring_offsets_m for lidar in lidars]) == pytest.approx(0.004, rel=0.1)
    cameras = [planted.of(f"rgb_{i}") for planted in drawn for i in (1, 2)]
    assert np.std([camera.focal_scale for camera in cameras]) == pytest.approx(0.002, rel=0.1)
    centre = np.array([camera.centre_px for camera in cameras])
    np.testing.assert_allclose(np.std(centre, axis=0), [0.002 * 1280, 0.002 * 800], rtol=0.1)
    for values in ([lidar.offset_m for lidar in lidars], centre[:, 0], centre[:, 1]):
        assert abs(np.mean(values)) < 3.5 * np.std(values) / np.sqrt(len(values))
    assert {planted.of_board("pattern_1") for planted in drawn} == {
        BoardErrors(scale=0.0015, bend_m=0.001)
    }


def test_every_sensor_of_a_rough_cell_detects_the_board():
    synthetic = paper_cell(6, realism=ROUGH)
    count = dict.fromkeys(synthetic.dataset.sensors, 0)
    for key, _ in synthetic.dataset.detections():
        count[key.sensor] += 1
    assert min(count.values()) >= 4


@pytest.mark.parametrize(
    "wrong", [{"lidar_offset_sigma_m": -0.1}, {"dark_lost": 1.0}, {"depth_halo_px": -1}]
)
def test_impossible_sizes_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        replace(PLAIN, **wrong)
