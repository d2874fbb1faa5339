"""A board's border in an image: whole, in short chords, and no farther than the image goes."""

import numpy as np
import pytest

from atom_core.evaluation.borders import clipped_to_image, projected_border
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.rectangle import Rectangle

FOCAL_PX = 1000.0
WIDTH, HEIGHT = 800, 600


def pinhole(width=WIDTH, height=HEIGHT):
    K = np.array([[FOCAL_PX, 0, width / 2], [0, FOCAL_PX, height / 2], [0, 0, 1]])
    return Camera(width, height, K, model="none")


BOARD = Rectangle(-0.10, -0.05, 0.20, 0.15)  # 0.3 m by 0.2 m


def at(x_m=0.0, y_m=0.0, z_m=1.0, turn_rad=(0.0, 0.0, 0.0)):
    rotation = se3.rotation_from_rotation_vector(np.array(turn_rad))
    return se3.transform(rotation, np.array([x_m, y_m, z_m]))


def lengths_px(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)


def test_a_board_square_before_the_camera_has_its_size_times_focal_length_over_distance():
    segments = projected_border(pinhole(), at(z_m=2.0), BOARD)
    low_px, high_px = segments.reshape(-1, 2).min(axis=0), segments.reshape(-1, 2).max(axis=0)
    np.testing.assert_allclose(low_px, [400 - 50, 300 - 25], atol=1e-9)
    np.testing.assert_allclose(high_px, [400 + 100, 300 + 75], atol=1e-9)
    assert lengths_px(segments).sum() == pytest.approx(2 * (0.3 + 0.2) * FOCAL_PX / 2.0)


def test_the_border_is_one_closed_line_of_chords_no_longer_than_a_centimetre():
    segments = projected_border(pinhole(), at(z_m=1.0, turn_rad=(0.0, 0.0, 0.3)), BOARD)
    np.testing.assert_allclose(segments[:, 1], np.roll(segments[:, 0], -1, axis=0), atol=1e-9)
    assert len(segments) in range(100, 105)
    assert lengths_px(segments).max() <= 0.01 * FOCAL_PX + 1e-9


def test_a_tilted_board_s_border_goes_through_its_projected_corners():
    camera, camera_T_board = pinhole(), at(0.05, -0.02, 0.9, (0.5, -0.4, 0.2))
    ends = projected_border(camera, camera_T_board, BOARD)[:, 0]
    corners = camera.project(
        se3.apply(camera_T_board, np.column_stack([BOARD.corners, np.zeros(4)]))
    )
    for corner in corners:
        assert np.min(np.linalg.norm(ends - corner, axis=1)) < 1e-9


def test_a_board_half_out_of_the_image_keeps_the_part_that_is_in_it():
    """Its left side is 60 px to the left of the image's edge; the image begins at -0.5."""
    segments = projected_border(pinhole(), at(x_m=-0.36), BOARD)
    kept_px = 240.0 + 0.5
    assert lengths_px(segments).sum() == pytest.approx(2 * kept_px + 200.0)
    assert segments[..., 0].min() == pytest.approx(-0.5)


def test_a_border_that_only_cuts_off_a_corner_of_the_image_is_kept():
    """The chord that does has both ends outside; the line is 2 px from the corner (-0.5, -0.5)."""
    along, away = np.array([1.0, -1.0]) / np.sqrt(2.0), np.array([1.0, 1.0]) / np.sqrt(2.0)
    start_px = np.array([-0.5, -0.5]) + 2.0 * away - 55.0 * along
    start_m = (start_px - [WIDTH / 2, HEIGHT / 2]) / FOCAL_PX
    turned = at(*start_m, 1.0, (0.0, 0.0, -np.pi / 4))
    segments = projected_border(pinhole(), turned, Rectangle(0.0, 0.0, 0.2, 0.2))
    (at_corner,) = np.flatnonzero(np.all(segments.reshape(-1, 4) < 20.0, axis=1))
    assert lengths_px(segments[at_corner : at_corner + 1]) == pytest.approx(4.0)


@pytest.mark.parametrize("size", [(400, 200), (200, 400)])
def test_chords_that_reach_farther_out_than_the_image_s_larger_side_are_left_out(size):
    """At 0.02 m of distance a chord of 1 cm is 500 px: more than either side."""
    camera, close = pinhole(*size), at(0.0, 0.0, 0.06)
    board = Rectangle(-0.03, -0.03, 0.03, 0.03)
    inside_px = np.array(size) / 2 + 500.0
    assert np.all(camera.project(se3.apply(close, np.array([[0.03, 0.03, 0]]))) == inside_px)
    assert len(projected_border(camera, close, board)) == 0


def test_of_a_floor_that_runs_on_behind_the_camera_only_what_is_before_it_is_seen():
    """Seen edges lie on lines to the horizon's middle; nothing is above the horizon."""
    camera, lying = pinhole(), at(0.0, 0.3, 0.0, (np.pi / 2, 0.0, 0.0))
    floor = Rectangle(-0.2, -3.0, 0.2, 3.0)
    for turn in (np.eye(4), at(0.0, 0.0, 0.0, (0.0, 0.0, np.pi))):
        segments = projected_border(camera, lying @ turn, floor)
        points = segments.reshape(-1, 2) - [WIDTH / 2, HEIGHT / 2]
        assert points[:, 1].min() == pytest.approx(0.3 * FOCAL_PX / 3.0)
        assert points[:, 1].max() == pytest.approx(HEIGHT / 2 - 0.5)
        farthest = points[:, 1] < 100.0 + 1e-6
        np.testing.assert_allclose(np.abs(points[~farthest, 0]), points[~farthest, 1] * 2 / 3)


def test_chords_that_begin_or_end_nearer_than_five_centimetres_are_left_out():
    """A strip 4 mm wide runs along the optical axis; its chords end at 45, 55, 65 mm and so on."""
    camera, along_axis = pinhole(), at(0.0, 0.0, -0.105, (np.pi / 2, 0.0, 0.0))
    strip = Rectangle(-0.002, 0.0, 0.002, 0.4)
    across_px = projected_border(camera, along_axis, strip)[..., 0] - WIDTH / 2
    nearest_px = 0.002 * FOCAL_PX / 0.055
    assert across_px.max() == pytest.approx(nearest_px)
    assert across_px.min() == pytest.approx(-nearest_px)


def test_an_image_reaches_half_a_pixel_beyond_the_centres_of_its_outer_pixels():
    camera = pinhole(40, 30)
    across = np.array([[[-100.0, 10.0], [100.0, 10.0]], [[20.0, 100.0], [20.0, -100.0]]])
    np.testing.assert_allclose(
        clipped_to_image(across, camera),
        [[[-0.5, 10.0], [39.5, 10.0]], [[20.0, 29.5], [20.0, -0.5]]],
    )


def test_a_segment_just_outside_the_image_s_edge_disappears_and_one_just_inside_stays():
    camera = pinhole(40, 30)
    beside = [[-0.51, 39.51], [-0.51, 29.51]]
    within = [[-0.49, 39.49], [-0.49, 29.49]]
    for places, kept in ((beside, 0), (within, 1)):
        for x_px in places[0]:
            upright = np.array([[[x_px, 5.0], [x_px, 6.0]]])
            assert len(clipped_to_image(upright, camera)) == kept
        for y_px in places[1]:
            level = np.array([[[5.0, y_px], [6.0, y_px]]])
            assert len(clipped_to_image(level, camera)) == kept
