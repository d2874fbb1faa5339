"""What a sensor has seen of boards, and what is still missing."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.labeling import guidance as g

WIDTH, HEIGHT = 640, 480


def view(box=(0.4, 0.4, 0.6, 0.6), distance_m=2.0, turn_deg=(0.0, 0.0)):
    """A board before a camera, turned about x and y."""
    normal = se3.rotation_from_rotation_vector(np.deg2rad([*turn_deg, 0.0]))[:, 2]
    tilt = np.rad2deg(np.arccos(normal[2]))
    return g.BoardView(np.array(box), distance_m, tilt, normal)


def varied():
    """Boards that leave nothing to wish for."""
    boxes = [(0.0, 0.1, 0.4, 0.5), (0.6, 0.5, 1.0, 0.9), (0.3, 0.0, 0.7, 0.4)]
    turns = [(0, 0), (30, 0), (-30, 5), (0, 35), (5, -35)]
    return [view(boxes[i % 3], 1.0 + 0.3 * (i % 4), turns[i % 5]) for i in range(12)]


def test_varied_boards_are_enough():
    found = g.guidance(varied(), has_image=True)
    assert found.enough and found.missing == () and found.sentence == "enough"
    assert len(found.views) == 12


def test_nothing_seen_needs_boards_before_all_else():
    found = g.guidance([], has_image=True)
    assert found.missing == (f"{g.LEAST_BOARDS} more boards",)
    one = g.guidance([view()] * (g.LEAST_BOARDS - 1), has_image=True)
    assert one.missing[0] == "1 more board"


@pytest.mark.parametrize(
    ("word", "kept"),
    [
        ("left", lambda v: v.box[0] > 1 / 3),
        ("right", lambda v: v.box[2] < 2 / 3),
        ("top", lambda v: v.box[1] > 1 / 3),
        ("bottom", lambda v: v.box[3] < 2 / 3),
    ],
)
def test_a_third_of_the_image_without_a_board_is_named(word, kept):
    rest = [v for v in varied() if kept(v)] * 4
    assert word in g.guidance(rest, has_image=True).missing


def test_boards_at_one_distance_need_others():
    far = [v._replace(distance_m=3.0, box=0.5 + 0.2 * (v.box - 0.5)) for v in varied()]
    assert "near" in g.guidance(far, has_image=True).missing
    near = [v._replace(distance_m=0.8) for v in varied()]
    assert "far" in g.guidance(near, has_image=True).missing
    assert "nearer or farther" in g.guidance(near, has_image=False).missing
    unknown = [v._replace(distance_m=np.nan) for v in varied()]
    assert "far" in g.guidance(unknown, has_image=True).missing


def test_boards_that_face_the_sensor_need_tilt_and_those_tilted_alike_another_one():
    flat = [v._replace(normal=view().normal, tilt_deg=0.0) for v in varied()]
    assert "tilted" in g.guidance(flat, has_image=True).missing
    alike = [
        v._replace(normal=w.normal, tilt_deg=w.tilt_deg)
        for v, w in zip(varied(), [view(turn_deg=(30 * (-1) ** i, 0)) for i in range(12)])
    ]
    assert g.guidance(alike, has_image=True).missing == ("tilted another way",)


@pytest.mark.parametrize(
    ("turns", "image_words", "all_round"),
    [
        ([(30 * (-1) ** i, 0) for i in range(12)], "to the left and right", None),
        ([(0, 30 * (-1) ** i) for i in range(12)], "up and down", None),
        ([(90, 8 * i) for i in range(12)], None, "up and down"),
    ],
)
def test_the_advice_says_which_way_to_tilt(turns, image_words, all_round):
    """Turned about x alone a camera's boards lean up and down: left and right is missing."""
    alike = [
        v._replace(normal=w.normal, tilt_deg=30.0)
        for v, w in zip(varied(), [view(turn_deg=turn) for turn in turns])
    ]
    if image_words:
        found = g.guidance(alike, has_image=True)
        assert found.advice == f"collect 3 boards for it: tilted {image_words}"
    if all_round:
        upright = [
            v._replace(normal=np.array([np.cos(i), np.sin(i), 0.0])) for i, v in enumerate(alike)
        ]
        assert g.guidance(upright, has_image=False).turns == all_round


def test_the_advice_names_places_and_numbers():
    rest = [v for v in varied() if v.box[0] > 1 / 3][:2]
    found = g.guidance(rest, has_image=True)
    assert found.advice.startswith(f"collect {g.LEAST_BOARDS - 2} boards for it: ")
    assert "in the left third of its view" in found.advice
    assert g.guidance(varied(), has_image=True).advice == ""
    assert g.guidance([], has_image=True).advice == f"collect {g.LEAST_BOARDS} boards for it"


def test_every_word_of_what_is_missing_has_its_advice():
    words = {"near", "far", "nearer or farther", "left", "right", "top", "bottom"}
    assert words | {"more to the sides", "tilted", "tilted another way"} == set(g._ADVICE)


def test_which_way_a_normal_points_does_not_matter():
    turned = [v._replace(normal=-v.normal) if i % 2 else v for i, v in enumerate(varied())]
    assert g.guidance(turned, has_image=True).missing == ()


def test_of_a_line_nobody_asks_for_tilt():
    lines = [v._replace(normal=np.full(3, np.nan), tilt_deg=np.nan) for v in varied()]
    assert g.guidance(lines, has_image=True).enough


def test_a_lidar_needs_directions_also_across_its_back():
    one_way = [v._replace(box=np.array([0.5, 0.4, 0.52, 0.6])) for v in varied()]
    assert g.guidance(one_way, has_image=False).missing == ("more to the sides",)
    behind = [
        v._replace(box=np.array([x - 0.01, 0.4, x + 0.01, 0.6]))
        for v, x in zip(varied(), [0.02, 0.98] * 6)
    ]
    assert "more to the sides" in g.guidance(behind, has_image=False).missing
    apart = [
        v._replace(box=np.array([x - 0.01, 0.4, x + 0.01, 0.6]))
        for v, x in zip(varied(), [0.45, 0.58] * 6)
    ]
    assert g.guidance(apart, has_image=False).enough


def test_the_box_of_pixels_is_in_shares_of_the_image():
    corners = np.array([[-0.5, -0.5], [WIDTH - 0.5, HEIGHT / 2 - 0.5]])
    figures = g.image_box(corners, WIDTH, HEIGHT)
    assert list(figures.values()) == pytest.approx([0.0, 0.0, 1.0, 0.5])
    seen = g.board_view({**figures, "distance_m": 2.0, **g.normal_figures(np.eye(3)[2])})
    np.testing.assert_array_equal(seen.box, list(figures.values()))
    assert seen.distance_m == 2.0 and np.isnan(seen.tilt_deg) and seen.normal[2] == 1.0
    assert g.image_box(np.zeros((0, 2)), WIDTH, HEIGHT) == {}
    assert g.board_view({"distance_m": 2.0}) is None


def test_the_map_of_a_lidar_has_its_x_axis_in_the_middle_and_left_to_the_left():
    ahead = g.board_view(g.all_round_box(np.array([[2.0, 0.0, 0.0]]))).box
    np.testing.assert_allclose(ahead, 0.5)
    left_above = g.board_view(g.all_round_box(np.array([[0.0, 2.0, 1.0], [np.nan] * 3]))).box
    assert left_above[0] == pytest.approx(0.25) and left_above[1] < 0.5
