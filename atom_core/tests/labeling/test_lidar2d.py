"""The 2D LiDAR's labeler against truth: poses, rooms, both rotations, and what it must refuse."""

import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from scan_scenes import (
    BORDER,
    DIAGONAL_M,
    MODELS,
    PATTERN,
    QUARTER,
    SHORTER_M,
    Furniture,
    clear_pose,
    furnished,
    rectangle,
    seen,
    shares,
)

from atom_core.errors import LabelingError
from atom_core.geometry import se3
from atom_core.labeling.lidar2d import (
    Lidar2dLabeler,
    Lidar2dOptions,
    background_of,
    cut_at,
    find_cut,
    find_cuts,
)
from atom_core.model.laser_scan import LaserScan
from atom_core.model.sensor import LIDAR2D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import hits
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Room

SENSOR = Sensor("laser", LIDAR2D, "laser", Edge("base", "laser"))
NO_BOXES = Lidar2dOptions(boxes=False)
MIXED_RAD = 0.005


def wide(model):
    """Return a model whose beams meet two things at an edge."""
    return replace(model, beam_width_rad=MIXED_RAD)


@lru_cache(maxsize=None)
def scene(seed, name="quarter", boxes=4):
    """Return a scan of a furnished room, a board in front of all, and the empty room's ranges."""
    model = MODELS[name]
    rng = np.random.default_rng(seed)
    room, world_T_lidar, stands = furnished(rng, boxes=boxes)
    pose = clear_pose(rng, stands, room, world_T_lidar)
    made = seen(rng, wide(model), pose, stands, room, world_T_lidar)
    rays = model.directions @ world_T_lidar[:3, :3].T
    walls = room.distance(world_T_lidar[:3, 3], rays)
    return made, np.minimum(walls, made.others)


def upright(x, y, turn=0.0, width_along=0.0):
    """Return a board upright in the scan's plane, its middle at (x, y), facing the sensor."""
    lidar_R_board = np.column_stack([[0, -1.0, 0], [0, 0, -1.0], [1.0, 0, 0]])
    facing = se3.rotation_from_rpy(np.array([0.0, 0.0, np.arctan2(y, x) + turn]))
    rotation = facing @ lidar_R_board @ se3.rotation_from_rpy(np.array([0, 0, width_along]))
    middle = np.append(BORDER.centre, 0.0)
    return se3.transform(rotation, np.array([x, y, 0.0]) - rotation @ middle)


def on_board(made, model=QUARTER):
    """Return the beams that meet the board."""
    return np.flatnonzero(np.isfinite(hits(made.lidar_T_board, BORDER, model.directions)[0]))


def assert_on_board(labeled, made, model=QUARTER):
    """A beam at the edge that met what is behind it, too, may be among them."""
    common = np.intersect1d(labeled.label.indices, on_board(made, model))
    assert len(labeled.label.indices) - len(common) <= 2


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", list(MODELS))
def test_with_a_seed_nearly_every_cut_is_found(name):
    cuts, found, extra, limits = 0, 0, 0, 0
    recall = []
    for seed in range(60):
        made, _ = scene(seed, name)
        if made.label is None:
            continue
        rng = np.random.default_rng(seed)
        point = made.middle + np.append(rng.normal(0.0, 0.03, 2), rng.normal(0.0, 0.1))
        labeled = cut_at(made.scan, BORDER, point)
        cuts += 1
        if not labeled.detected:
            assert labeled.reason
            continue
        found += 1
        assert_on_board(labeled, made, MODELS[name])
        recall.append(shares(labeled.label.indices, made.label.indices)[1])
        apart = np.abs(made.label.limit_indices[:, None] - labeled.label.limit_indices[None])
        extra += int(np.sum(np.all(apart > 1, axis=0)))
        limits += len(labeled.label.limit_indices)
    assert cuts > 25 and found >= 0.95 * cuts
    assert np.mean(recall) > 0.99 and extra <= 0.01 * limits


@pytest.mark.parametrize("name", list(MODELS))
def test_before_a_known_background_nearly_every_cut_is_found_and_nothing_else(name):
    cuts, found = 0, 0
    for seed in range(60):
        made, background = scene(seed, name)
        labeled = find_cut(made.scan, BORDER, background=background)
        if labeled.detected:
            assert_on_board(labeled, made, MODELS[name])
        if made.label is not None and len(made.label.limit_indices) == 2:
            cuts, found = cuts + 1, found + labeled.detected
    assert cuts > 25 and found >= 0.9 * cuts


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", list(MODELS))
def test_in_rooms_without_boxes_nearly_every_cut_is_found_and_nothing_else(name):
    cuts, found = 0, 0
    for seed in range(60):
        made, _ = scene(seed, name, boxes=0)
        labeled = find_cut(made.scan, BORDER, NO_BOXES)
        if labeled.detected:
            assert_on_board(labeled, made, MODELS[name])
        if made.label is not None and len(made.label.limit_indices) == 2:
            cuts, found = cuts + 1, found + labeled.detected
    assert cuts > 25 and found >= 0.9 * cuts


@pytest.mark.parametrize("name", list(MODELS))
def test_in_any_room_nothing_but_the_board_is_labeled(name):
    found = 0
    for seed in range(60):
        made, _ = scene(seed, name)
        labeled = find_cut(made.scan, BORDER)
        if labeled.detected:
            found += 1
            assert_on_board(labeled, made, MODELS[name])
        else:
            assert labeled.reason
    assert found > 5 or name in ("one", "half_270")


@pytest.mark.parametrize("name", ["quarter", "half_270", "one"])
def test_in_rooms_without_a_board_nothing_is_labeled(name):
    for seed in range(100):
        rng = np.random.default_rng(1000 + seed)
        room, world_T_lidar, stands = furnished(rng, boxes=5, doors=2, plates=True)
        made = seen(rng, wide(MODELS[name]), None, stands, room, world_T_lidar)
        assert not find_cut(made.scan, BORDER).detected, seed


def test_the_label_of_a_plain_scene_is_the_true_one():
    for seed, turn in enumerate((-1.1, -0.6, 0.0, 0.3, 0.9)):
        made = seen(np.random.default_rng(seed), lidar_T_board=upright(2.0, 0.5, turn))
        labeled = cut_at(made.scan, BORDER, made.middle)
        assert np.array_equal(labeled.label.indices, made.label.indices)
        assert np.array_equal(labeled.label.limit_indices, made.label.limit_indices)
        assert len(labeled.label.limit_indices) == 2
        assert labeled.quality["length_m"] == pytest.approx(0.8, abs=0.06)
        assert labeled.quality["line_rms_m"] == pytest.approx(0.01 * np.cos(turn), abs=0.003)
        assert labeled.quality["incidence_deg"] == pytest.approx(np.degrees(abs(turn)), abs=1.5)
        assert np.linalg.norm(labeled.next_seed - made.middle) < 0.02


@pytest.mark.parametrize("turn", np.radians([-60.0, 0.0, 35.0]))
def test_across_the_seam_and_in_both_rotations_the_label_is_the_same(turn):
    pose = upright(-1.8, 0.1, turn)
    lengths = []
    for name in ("quarter", "clockwise"):
        made = seen(np.random.default_rng(0), MODELS[name], pose, noise=Noise(lidar_m=0.002))
        for labeled in (
            cut_at(made.scan, BORDER, made.middle),
            find_cut(made.scan, BORDER, NO_BOXES),
        ):
            indices = labeled.label.indices
            assert indices.min() < 20 and indices.max() > 1420
            assert np.array_equal(indices, np.sort(made.label.indices))
            assert np.array_equal(labeled.label.limit_indices, made.label.limit_indices)
            lengths.append(labeled.quality["length_m"])
    assert np.ptp(lengths) < 0.02


@pytest.mark.parametrize("off", [(0.08, 0.0, 0.0), (0.0, 0.1, 0.0), (-0.1, 0.05, 0.3)])
def test_a_seed_beside_the_cut_or_off_the_plane_finds_it(off):
    made = seen(np.random.default_rng(3), lidar_T_board=upright(2.5, -1.0, 0.4))
    labeled = cut_at(made.scan, BORDER, made.middle + off)
    assert_on_board(labeled, made)
    assert len(labeled.label.indices) > 0.97 * len(made.label.indices)


@pytest.mark.parametrize("name", ["quarter", "one"])
def test_about_a_predicted_place_the_board_is_found_or_nothing(name):
    cuts, found = 0, 0
    for seed in range(60):
        made, _ = scene(seed, name)
        if made.label is None:
            continue
        rng = np.random.default_rng(seed)
        middle = (made.lidar_T_board @ np.append(BORDER.centre, [0.0, 1.0]))[:3]
        predicted = middle + np.append(rng.normal(0.0, 0.2, 2), 0.0)
        labeled = Lidar2dLabeler(SENSOR, PATTERN).label(made.scan, predicted, reach_m=0.7)
        cuts, found = cuts + 1, found + labeled.detected
        if labeled.detected:
            assert_on_board(labeled, made, MODELS[name])
    assert cuts > 25 and found >= 0.9 * cuts


def test_about_a_predicted_place_two_possible_boards_give_none():
    plate = corner_room([[1.7, 0.7], [2.1, 1.2]])
    made = seen(np.random.default_rng(0), lidar_T_board=upright(2.0, 0.0, 0.3), furniture=plate)
    between = np.array([2.0, 0.5, 0.0])
    labeled = Lidar2dLabeler(SENSOR, PATTERN).label(made.scan, between, reach_m=0.7)
    assert "2 segments within 0.70 m of the predicted place" in labeled.reason
    near = Lidar2dLabeler(SENSOR, PATTERN).label(made.scan, made.middle, reach_m=0.2)
    assert_on_board(near, made)
    assert near.detected


def test_a_seed_far_from_everything_says_how_far():
    made = seen(np.random.default_rng(3), lidar_T_board=upright(2.5, 0.0))
    labeled = cut_at(made.scan, BORDER, np.array([0.0, 1.5, 0.0]))
    assert not labeled.detected and "no return lies within 0.25 m" in labeled.reason


def test_behind_a_post_both_parts_are_labeled_and_the_ends_are_the_boards():
    pose = upright(2.0, 0.0)
    post = Furniture(np.zeros((0, 2, 2)), np.array([[1.5, 0.05, 0.04]]))
    made = seen(np.random.default_rng(0), lidar_T_board=pose, furniture=post)
    labeled = cut_at(made.scan, BORDER, made.middle)
    assert np.array_equal(labeled.label.indices, made.label.indices)
    assert np.array_equal(labeled.label.limit_indices, made.label.limit_indices)


def test_an_end_that_is_hidden_or_out_of_view_is_no_limit_point():
    pose = upright(2.0, 0.0)
    wall = Furniture(np.array([[[1.0, 0.06], [1.0, 1.8]]]), np.zeros((0, 3)))
    hidden = seen(np.random.default_rng(0), lidar_T_board=pose, furniture=wall)
    half = replace(QUARTER, angle_min=0.0, beams=400)
    cut_off = seen(np.random.default_rng(0), half, pose)
    for made in (hidden, cut_off):
        labeled = cut_at(made.scan, BORDER, made.middle)
        assert labeled.detected and len(made.label.limit_indices) == 1
        assert np.array_equal(labeled.label.limit_indices, made.label.limit_indices)
        assert not find_cut(made.scan, BORDER, NO_BOXES).detected


def test_black_squares_that_swallow_beams_do_not_end_the_cut():
    made = seen(np.random.default_rng(0), lidar_T_board=upright(1.5, 0.3, 0.3))
    ranges = made.scan.ranges.copy()
    ranges[made.label.indices[12:30]] = 0.0
    ranges[made.label.indices[45:60]] = np.nan
    lost = replace(made.scan, ranges=ranges)
    labeled = cut_at(lost, BORDER, made.middle)
    kept = made.label.indices[lost.valid[made.label.indices]]
    assert np.array_equal(labeled.label.indices, kept)
    assert np.array_equal(labeled.label.limit_indices, made.label.limit_indices)


def test_an_end_beside_swallowed_beams_is_free_but_no_limit_point():
    made = seen(np.random.default_rng(0), lidar_T_board=upright(1.5, 0.3, 0.3))
    ranges = made.scan.ranges.copy()
    ranges[made.label.indices[:10]] = 0.0
    labeled = cut_at(replace(made.scan, ranges=ranges), BORDER, made.middle)
    assert labeled.label.limit_indices.tolist() == [made.label.indices[-1]]
    assert labeled.quality["free_ends"] == 2


@pytest.mark.parametrize("silent", [np.inf, 0.0, np.nan])
@pytest.mark.parametrize("middle_deg", [0.0, 12.0, 90.0, 180.0])
def test_outdoors_the_seam_of_a_whole_turn_is_as_open_as_any_other_gap(middle_deg, silent):
    turn = np.radians(middle_deg)
    pose = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, turn])) @ upright(2.0, 0.0, 0.35)
    made = seen(np.random.default_rng(0), MODELS["one"], pose)
    ranges = np.full(len(made.scan.ranges), silent)
    ranges[made.label.indices] = made.scan.ranges[made.label.indices]
    away_deg = np.degrees(np.angle(np.exp(1j * (made.scan.angles - turn))))
    for sides in ((), (1,), (1, -1)):  # walls beside the board
        for side in sides:
            ranges[np.abs(side * away_deg - 90.0) < 30.0] = 6.0
        scan = replace(made.scan, ranges=ranges)
        for found in (cut_at(scan, BORDER, made.middle), find_cut(scan, BORDER, NO_BOXES)):
            assert found.detected, found.reason
            assert np.array_equal(found.label.indices, np.sort(made.label.indices))
            assert len(found.label.limit_indices) == 2


@pytest.mark.parametrize("step_m", [0.005, 0.01, 0.02])
def test_quantised_ranges(step_m):
    found = 0
    for seed in range(15):
        made, _ = scene(seed)
        if made.label is None or not cut_at(made.scan, BORDER, made.middle).detected:
            continue
        ranges = np.round(made.scan.ranges / step_m) * step_m
        labeled = cut_at(replace(made.scan, ranges=ranges), BORDER, made.middle)
        assert labeled.detected
        assert_on_board(labeled, made)
        found += 1
    assert found > 5


@pytest.mark.parametrize("sigma_m", [0.0, 0.003, 0.015])
def test_other_noise(sigma_m):
    for seed, turn in enumerate((-0.9, 0.0, 0.5)):
        noise = Noise(lidar_m=sigma_m)
        made = seen(np.random.default_rng(seed), QUARTER, upright(2.0, 1.0, turn), noise=noise)
        labeled = cut_at(made.scan, BORDER, made.middle)
        assert shares(labeled.label.indices, made.label.indices) > (0.97, 0.97)


def corner_room(*segments):
    return Furniture(np.array(segments, dtype=float), np.zeros((0, 3)))


@pytest.mark.parametrize(
    ("name", "stands", "seed"),
    [
        ("wall", [[[2.0, -4.0], [2.0, 4.0]]], (2.0, 0.0, 0.0)),
        (
            "wall between two openings",
            [[[2.0, -3.0], [2.0, -1.2]], [[2.0, -0.4], [2.0, 0.4]], [[2.0, 1.2], [2.0, 3.0]]],
            (2.0, 0.0, 0.0),
        ),
        (
            "wall seen between two cupboards",
            [[[2.0, -4.0], [2.0, 4.0]], [[1.2, -2.0], [1.2, -0.25]], [[1.2, 0.25], [1.2, 2.0]]],
            (2.0, 0.0, 0.0),
        ),
        (
            "corner of a room",
            [[[2.0, 0.0], [2.0, 0.5]], [[2.0, 0.0], [1.2, -0.3]]],
            (2.0, 0.3, 0.0),
        ),
        ("box", list(rectangle(2.0, 0.0, 0.6, 0.8, 0.6)), None),
        ("leg", list(rectangle(2.0, 0.0, 0.2, 0.05, 0.05)), (1.97, 0.0, 0.0)),
        (
            "door flush with its wall",
            [[[2.0, -4.0], [2.0, -0.4]], [[2.04, -0.4], [2.04, 0.4]], [[2.0, 0.4], [2.0, 4.0]]],
            (2.04, 0.0, 0.0),
        ),
        ("door ajar", [[[3.0, -4.0], [3.0, 4.0]], [[3.0, 0.5], [2.4, 0.0]]], None),
    ],
)
def test_what_is_no_board_is_refused_with_a_reason(name, stands, seed):
    made = seen(np.random.default_rng(0), furniture=corner_room(*stands))
    if seed is not None:
        labeled = cut_at(made.scan, BORDER, np.array(seed))
        assert not labeled.detected and labeled.reason, name
    for options in (Lidar2dOptions(), NO_BOXES):
        labeled = find_cut(made.scan, BORDER, options)
        assert not labeled.detected and labeled.reason, name


@pytest.mark.parametrize("radius", [0.05, 0.15, 0.3, 0.6])
def test_a_round_thing_is_refused(radius):
    post = Furniture(np.zeros((0, 2, 2)), np.array([[2.5, 0.0, radius]]))
    made = seen(np.random.default_rng(0), furniture=post)
    assert not cut_at(made.scan, BORDER, np.array([2.5 - radius, 0.0, 0.0])).detected
    assert not find_cut(made.scan, BORDER, NO_BOXES).detected


def test_a_box_seen_from_the_front_is_not_labeled_without_a_seed():
    box = corner_room(*rectangle(2.0, 0.0, np.pi / 2, 0.8, 0.5))
    made = seen(np.random.default_rng(0), furniture=box)
    labeled = find_cut(made.scan, BORDER)
    assert "may be a box seen from the front" in labeled.reason
    assert find_cut(made.scan, BORDER, NO_BOXES).detected  # one scan cannot tell it from a board


def test_a_plate_seen_at_an_angle_can_be_no_box():
    made = seen(np.random.default_rng(0), lidar_T_board=upright(2.0, 0.0, 0.7))
    labeled = find_cut(made.scan, BORDER)
    assert np.array_equal(labeled.label.indices, made.label.indices)


def test_of_two_possible_boards_none_is_labeled_but_each_with_its_seed():
    plate = corner_room([[1.0, 1.4], [0.4, 1.8]])
    made = seen(np.random.default_rng(0), lidar_T_board=upright(2.0, 0.0, 0.7), furniture=plate)
    labeled = find_cut(made.scan, BORDER)
    assert "2 segments may be the board's cut" in labeled.reason
    assert len(find_cuts(made.scan, BORDER)) == 2
    assert_on_board(cut_at(made.scan, BORDER, made.middle), made)


def test_the_background_of_scans_is_what_does_not_move():
    scans = []
    for seed, y in enumerate(np.linspace(-2.0, 2.0, 7)):
        made = seen(np.random.default_rng(seed), lidar_T_board=upright(2.0, y))
        scans.append(made.scan)
    walls = Room((-5.0, -5.0, 0.0), (5.0, 5.0, 3.0))
    expected = walls.distance(np.array([0.0, 0.0, 1.0]), QUARTER.directions)
    assert np.max(np.abs(background_of(scans) - expected)) < 0.05
    with pytest.raises(LabelingError, match="the same beams"):
        background_of([*scans, seen(np.random.default_rng(0), MODELS["one"]).scan])
    with pytest.raises(LabelingError, match="the same beams"):
        background_of([])


def test_the_labeler_takes_scans_and_points_only():
    labeler = Lidar2dLabeler(SENSOR, PATTERN)
    made = seen(np.random.default_rng(0), lidar_T_board=upright(2.0, 0.0, 0.7))
    assert labeler.label(made.scan, made.middle).detected
    assert labeler.label(made.scan).detected
    with pytest.raises(LabelingError, match="sensor 'laser', pattern 'board'.*LaserScan, not"):
        labeler.label(made.scan.ranges)
    for bad in ([1.0, 2.0], [np.nan, 0.0, 0.0]):
        with pytest.raises(LabelingError, match="a seed is a point"):
            labeler.label(made.scan, np.array(bad))


def test_a_scan_with_few_returns_gives_a_reason_and_no_error():
    for count in (1, 2, 3):
        ranges = np.full(360, np.inf)
        ranges[100 : 100 + count] = 2.0
        scan = LaserScan(ranges, -np.pi, 2 * np.pi / 360, 0.1, 10.0)
        assert find_cut(scan, BORDER, NO_BOXES).reason
        assert cut_at(scan, BORDER, scan.points[100]).reason


def test_lengths_of_this_board():
    assert 2.0 * BORDER.half_size.min() == pytest.approx(SHORTER_M)
    assert 2.0 * np.hypot(*BORDER.half_size) == pytest.approx(DIAGONAL_M)
