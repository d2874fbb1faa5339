"""Depth images: the board's pixels, all and no others; nothing where there is no board."""

import numpy as np
import pytest

from atom_core.errors import LabelingError
from atom_core.geometry import se3
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.base import labeler_for
from atom_core.labeling.depth import DepthLabeler, DepthOptions, to_metres
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import DEPTH, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco, hits
from atom_core.synthetic.rig import pinhole

PLAIN = pinhole(640, 480, 554.0)
BENT = pinhole(640, 480, 554.0, (0.12, -0.2, 0.002, -0.001, 0.05))
CONFIG = charuco()
PATTERN = pattern_from_config("pattern_1", CONFIG)
WALL_M = 3.6


def sensor(camera=PLAIN):
    return Sensor("depth_1", DEPTH, "depth_1_optical_frame", Edge("world", "depth_1"), camera)


def labeler(camera=PLAIN, **options):
    return DepthLabeler(sensor(camera), PATTERN, CONFIG, DepthOptions(**options))


def held(distance_m, rpy=(0.0, 0.0, 0.0), offset=(0.0, 0.0)):
    pose = se3.from_rpy(np.zeros(3), np.array(rpy))
    middle = pose[:3, :3] @ np.append(PATTERN.border.centre, 0.0)
    pose[:3, 3] = np.array([*offset, distance_m]) - middle
    return pose


class View:
    """A wall and a floor, boards before them, and what a depth camera makes of it."""

    def __init__(self, camera=PLAIN, floor_m=1.1):
        self.camera = camera
        row, column = np.mgrid[0 : camera.height, 0 : camera.width]
        flat = camera.normalise(np.column_stack([column.ravel(), row.ravel()]))
        self.rays = np.column_stack([flat, np.ones(len(flat))])
        with np.errstate(divide="ignore"):
            floor = np.where(flat[:, 1] > 0, floor_m / np.maximum(flat[:, 1], 1e-9), np.inf)
        self.z = np.minimum(WALL_M, floor)
        self.truth = np.zeros(len(flat), dtype=bool)

    def add(self, camera_T_pattern, border=PATTERN.border, board=True):
        z, _ = hits(camera_T_pattern, border, self.rays)
        nearer = z < self.z
        self.z = np.where(nearer, z, self.z)
        self.truth = np.where(nearer, board, self.truth)
        return self

    def add_box(self, low, high):
        """Add something that covers pixels low[:2] to high[:2] at the depth low[2] [m]."""
        row, column = np.mgrid[0 : self.camera.height, 0 : self.camera.width]
        inside = (
            (column >= low[0]) & (column <= high[0]) & (row >= low[1]) & (row <= high[1])
        ).ravel()
        self.z = np.where(inside, np.minimum(self.z, low[2]), self.z)
        self.truth &= ~inside
        return self

    def image(self, seed=0, bleeding=True):
        """Return depths with noise, gaps and bleeding edges, and which pixels are mixed."""
        rng = np.random.default_rng(seed)
        shape = (self.camera.height, self.camera.width)
        z = self.z.reshape(shape)
        padded = np.pad(z, 1, mode="edge")
        around = [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
        nearest = np.minimum.reduce(around)
        mixed = z - nearest > 0.05
        share = rng.random(shape)
        if bleeding:
            z = np.where(mixed, z - share * (z - nearest), z)
        z = z + depth_sigma_m(z) * rng.standard_normal(shape)
        z[rng.random(shape) < 0.01] = np.nan
        return z.astype(np.float32), mixed.ravel()

    @property
    def seed(self):
        rows, columns = np.divmod(np.flatnonzero(self.truth), self.camera.width)
        return np.array([columns.mean(), rows.mean()])


def figures(found, view, depth_m, mixed):
    """Return precision and recall of the label; mixed pixels count for neither."""
    labeled = np.union1d(found.label.indices, found.label.limit_indices)
    counted = labeled[~mixed[labeled]]
    truth = np.flatnonzero(view.truth & np.isfinite(depth_m.ravel()))
    return np.mean(view.truth[counted]), np.mean(np.isin(truth, labeled))


POSES = [
    held(1.5),
    held(1.2, (0.3, -0.5, 0.4)),
    held(2.2, (0.9, 0.2, -1.0)),
    held(2.8, (0.2, 0.8, 2.0), (0.5, -0.3)),
    held(2.0, (-0.4, -0.4, 0.785)),
    held(1.8, (0.1, 0.3, 0.3), (1.1, 0.0)),  # cut off on the right
    held(1.7, (0.1, 0.3, 0.8), (0.8, -0.75)),  # cut off in the corner above
    held(0.9, (0.1, -0.2, 0.2), (0.3, 0.1)),  # large
]

LITTLE_IN_VIEW = 5  # 43 %: another board may have one side as long
CORNER_ONLY = 6  # cut off in the corner above: nothing tells how large the thing is


@pytest.mark.sampled(8)
@pytest.mark.parametrize("camera", [PLAIN, BENT], ids=["plain", "distorted"])
@pytest.mark.parametrize("number", range(len(POSES)))
def test_the_label_is_the_board(camera, number):
    view = View(camera).add(POSES[number])
    depth_m, mixed = view.image(number)
    found = labeler(camera, step=1).label(depth_m, view.seed)
    if number == CORNER_ONLY:
        assert not found.detected and "so that its size is not known" in found.reason
        found = found.unsure
    assert found.detected, found.reason
    precision, recall = figures(found, view, depth_m, mixed)
    assert precision >= 0.995
    assert recall >= 0.94


WHOLE = [k for k in range(len(POSES)) if k not in (LITTLE_IN_VIEW, CORNER_ONLY)]


@pytest.mark.parametrize("number", WHOLE)
def test_the_board_is_found_without_a_seed(number):
    view = View().add(POSES[number])
    depth_m, mixed = view.image(number)
    found = labeler(step=1).label(depth_m)
    assert found.detected, found.reason
    precision, recall = figures(found, view, depth_m, mixed)
    assert precision >= 0.995 and recall >= 0.94


@pytest.mark.parametrize("number", WHOLE)
def test_a_board_with_nothing_in_reach_behind_it_is_found(number):
    view = View().add(POSES[number])
    depth_m, mixed = view.image(number)
    depth_m[~view.truth.reshape(depth_m.shape)] = np.nan
    for seed in (view.seed, None):
        found = labeler(step=1).label(depth_m, seed)
        assert found.detected, found.reason
        assert figures(found, view, depth_m, mixed)[1] >= 0.94


def test_a_search_takes_no_board_of_which_little_is_in_view():
    view = View().add(POSES[LITTLE_IN_VIEW])
    depth_m, _ = view.image(LITTLE_IN_VIEW)
    found = labeler(step=1).label(depth_m)
    assert not found.detected
    assert "only 43% of a board there are in view: set a seed on it" in found.reason


def test_a_corner_at_the_images_edge_needs_a_camera():
    view = View().add(POSES[CORNER_ONLY])
    depth_m, _ = view.image(CORNER_ONLY)
    for found in (labeler().label(depth_m), labeler().label(depth_m, view.seed)):
        assert not found.detected and "let a camera see it, too" in found.reason


def test_limit_points_lie_on_the_border_and_not_at_the_images_edge():
    view = View().add(POSES[5])
    depth_m, _ = view.image()
    limit = labeler().label(depth_m, view.seed).label.limit_indices
    rows, columns = np.divmod(limit, 640)
    assert len(limit) > 100
    assert columns.max() <= 637 and rows.max() <= 477 and min(columns.min(), rows.min()) >= 2
    points = PLAIN.ray_points(np.column_stack([columns, rows]).astype(float), view.z[limit])
    in_pattern = se3.apply(se3.inverse(POSES[5]), points)
    distance, _ = PATTERN.border.signed_distance(in_pattern[:, :2])
    assert np.quantile(np.abs(distance), 0.95) <= 2.0 * 1.8 / 554


def test_inside_points_are_a_grid_without_the_border():
    view = View().add(POSES[1])
    depth_m, _ = view.image()
    label = labeler(step=4).label(depth_m, view.seed).label
    rows, columns = np.divmod(label.indices, 640)
    assert np.all(rows % 4 == 0) and np.all(columns % 4 == 0)
    assert len(np.intersect1d(label.indices, label.limit_indices)) == 0


def test_the_next_seed_is_the_centroid_and_follows_the_board():
    finder = labeler()
    seed = View().add(held(1.6)).seed
    for x in (0.0, 0.15, 0.3, 0.45):
        view = View().add(held(1.6, (0.2, 0.1, x), (x, 0.0)))
        found = finder.label(view.image()[0], seed)
        np.testing.assert_allclose(found.next_seed, view.seed, atol=1.5)
        seed = found.next_seed


def test_a_seed_in_a_gap_still_works():
    view = View().add(POSES[0])
    depth_m, _ = view.image()
    x, y = np.rint(view.seed).astype(int)
    depth_m[y - 2 : y + 3, x - 2 : x + 3] = np.nan
    assert labeler().label(depth_m, view.seed).detected


def test_a_post_that_touches_the_board_is_not_labeled():
    view = View().add(POSES[0])
    rows, columns = np.divmod(np.flatnonzero(view.truth), 640)
    x, y = int(columns.mean()), int(rows.max())
    truth = view.truth.copy()
    view.add_box((x - 8, y + 1, 1.5), (x + 8, 479, 1.5))
    depth_m, mixed = view.image()
    found = labeler(step=1).label(depth_m, view.seed)
    view.truth = truth
    assert found.detected and figures(found, view, depth_m, mixed)[0] >= 0.99


def test_a_post_in_the_boards_plane_is_not_labeled():
    pose = held(2.4, (0.6, 0.5, 0.2))
    view = View().add(pose)
    low, high = PATTERN.border.y_max, PATTERN.border.y_max + 0.5
    view.add(pose, Rectangle(0.32, low, 0.36, high), board=False)
    depth_m, mixed = view.image()
    found = labeler(step=1).label(depth_m, view.seed)
    assert found.detected, found.reason
    precision, recall = figures(found, view, depth_m, mixed)
    assert precision >= 0.99 and recall >= 0.94


def registered(depth_m, larger):
    """Return an image as registering a coarser one, pixel by pixel, leaves it: regular holes."""
    rows, columns = (
        np.unique((np.arange(int(side / larger)) * larger + 0.5).astype(int))
        for side in depth_m.shape
    )
    made = np.full_like(depth_m, np.nan)
    made[np.ix_(rows, columns)] = depth_m[np.ix_(rows, columns)]
    return made


@pytest.mark.parametrize("larger", [1.04, 1.07, 1.25, 1.5])
def test_regular_holes_of_an_image_that_was_registered_are_bridged(larger):
    view = View().add(POSES[1])
    whole, mixed = view.image(1)
    depth_m = registered(whole, larger)
    for seed in (view.seed, None):
        found = labeler().label(depth_m, seed)
        assert found.detected, found.reason
        assert figures(found, view, depth_m, mixed)[0] >= 0.995


@pytest.mark.parametrize("larger", [2.0, 3.0])
def test_an_image_of_single_pixels_has_a_remedy(larger):
    view = View().add(POSES[1])
    depth_m = registered(view.image(1)[0], larger)
    for seed in (view.seed, None):
        assert "fill_upsampling_holes" in labeler().label(depth_m, seed).reason


def test_an_arm_before_the_board_is_not_labeled_and_gives_no_limit_points():
    view = View().add(POSES[0])
    view.add_box((300, 0, 1.2), (330, 200, 1.2))
    depth_m, mixed = view.image()
    found = labeler(step=1).label(depth_m, np.array([400.0, 300.0]))
    assert found.detected, found.reason
    assert figures(found, view, depth_m, mixed)[0] >= 0.99
    rows, columns = np.divmod(found.label.limit_indices, 640)
    assert not np.any((np.abs(columns - 315) < 20) & (rows > 150) & (rows < 198))


# ---- what is no board


@pytest.mark.parametrize(
    ("seed", "what"),
    [((320.0, 60.0), "wall"), ((320.0, 450.0), "floor"), ((120.0, 240.0), "person")],
)
def test_other_things_are_not_labeled(seed, what):
    view = View().add(POSES[3]).add_box((80, 100, 2.0), (170, 479, 2.0))
    found = labeler().label(view.image()[0], np.array(seed))
    assert not found.detected and found.reason, what


def test_nothing_is_found_where_there_is_no_board():
    view = View().add_box((80, 100, 2.0), (170, 479, 2.0)).add_box((300, 300, 1.5), (330, 479, 1.5))
    found = labeler().label(view.image()[0])
    assert not found.detected and "no plane region" in found.reason


def test_a_piece_of_floor_between_nearer_things_is_no_board():
    view = View(floor_m=0.9)
    edges = [(200, 250, 212, 479), (420, 250, 432, 479), (200, 470, 432, 479), (200, 310, 432, 320)]
    for left, top, right, bottom in edges:
        view.add_box((left, top, 1.6), (right, bottom, 1.6))
    depth_m, _ = view.image()
    for seed in (None, np.array([316.0, 390.0])):
        assert not labeler().label(depth_m, seed).detected


@pytest.mark.parametrize("size", [0.7, 1.4])
def test_a_board_of_another_size_is_not_labeled(size):
    other = charuco(size=0.06 * size, inner_size=0.045 * size, border_size=(0.04 * size,) * 2)
    border = pattern_from_config("p", other).border
    view = View().add(held(1.8, (0.2, 0.2, 0.3)), border)
    found = labeler().label(view.image()[0], view.seed)
    assert not found.detected
    assert "the configuration says 0.80 x 0.60" in found.reason or "too large" in found.reason


def test_a_wall_that_fills_the_image_is_not_labeled():
    found = labeler().label(np.full((480, 640), 0.6, np.float32), np.array([320.0, 240.0]))
    assert not found.detected and "wall" in found.reason


def test_a_polygon_limits_where_is_looked():
    view = View().add(POSES[1])
    depth_m, _ = view.image()
    around = np.array([[0, 0], [100, 0], [100, 479], [0, 479]])
    assert not labeler().label(depth_m, polygon=around).detected
    everything = np.array([[0, 0], [639, 0], [639, 479], [0, 479]])
    assert labeler().label(depth_m, polygon=everything).detected


# ---- units and bad input


def test_encodings():
    millimetres = np.array([[0, 1500]], np.uint16)
    np.testing.assert_allclose(to_metres(millimetres, "16UC1"), [[np.nan, 1.5]], rtol=1e-6)
    metres = np.array([[np.nan, 1.5, 0.0, np.inf]], np.float32)
    np.testing.assert_array_equal(to_metres(metres, "32FC1"), [[np.nan, 1.5, np.nan, np.nan]])


@pytest.mark.parametrize(
    ("image", "encoding", "message"),
    [
        (np.zeros((4, 4), np.uint8), "mono8", "none of depth images"),
        (np.zeros((4, 4), np.uint8), "16UC1", "uint16"),
        (np.zeros((4, 4, 3), np.float32), "32FC1", "float32"),
        (np.zeros((0, 0), np.uint16), "16UC1", "not"),
    ],
)
def test_wrong_encodings_are_refused(image, encoding, message):
    with pytest.raises(LabelingError, match=message):
        to_metres(image, encoding)


@pytest.mark.parametrize("seeded", [True, False])
@pytest.mark.parametrize(("factor", "named"), [(1000.0, "0.001"), (10.0, "0.1"), (0.001, "1000")])
def test_another_unit_is_named(factor, named, seeded):
    view = View().add(POSES[1])
    wrong = view.image()[0] * np.float32(factor)
    with pytest.raises(LabelingError, match=rf"multiplied by {named};"):
        labeler().label(wrong, view.seed if seeded else None)


@pytest.mark.parametrize(
    ("image", "seed", "message"),
    [
        (np.zeros((480, 640), np.uint16), None, "to_metres"),
        (np.zeros((240, 320), np.float32), None, "camera_info says 640 x 480"),
        (np.ones((480, 640), np.float32), np.array([640.0, 3.0]), "is no pixel"),
    ],
)
def test_wrong_images_and_seeds_are_refused(image, seed, message):
    with pytest.raises(LabelingError, match=message):
        labeler().label(image, seed)


def test_an_image_without_depth_has_a_reason():
    empty = np.full((480, 640), np.nan, np.float32)
    assert "no depth" in labeler().label(empty, np.array([3.0, 3.0])).reason
    assert not labeler().label(empty).detected


def test_the_registry_knows_the_modality():
    assert isinstance(labeler_for(sensor(), PATTERN, CONFIG), DepthLabeler)
