"""Borders picked in clouds: keys, the file, and what is calibrated with the corners."""

import json
from argparse import Namespace
from types import SimpleNamespace

import numpy as np
import pytest

from atom_core import cli
from atom_core.commands.annotate_pattern_borders_in_lidar import Picking
from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.geometry.plane import plane_as_seen
from atom_core.io.annotations import annotation_path, read_annotations
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.lidar_annotations import (
    PickedSides,
    corners_of,
    read_picked_sides,
    write_picked_sides,
)
from atom_core.model.dataset import board_edge, pose
from atom_core.synthetic import Noise, scenes

# Of a rectangle from (0, 0) to (4, 2): two points of each side.
SIDES = {
    "top": [(1.0, 0.0), (3.0, 0.0)],
    "right": [(4.0, 0.5), (4.0, 1.5)],
    "bottom": [(1.0, 2.0), (2.0, 2.0)],
    "left": [(0.0, 0.2), (0.0, 1.9)],
}


def test_a_plane_is_seen_with_z_away_and_y_down():
    rng = np.random.default_rng(0)
    points = np.column_stack([np.full(40, 3.0), rng.uniform(-1, 1, 40), rng.uniform(-1, 1, 40)])
    frame = plane_as_seen(points)
    np.testing.assert_allclose(frame[:3, :3], [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(frame[:3, 3], points.mean(axis=0))


def test_corners_are_where_lines_through_the_points_meet():
    frame = se3.random_move(2.0, 1.0, np.random.default_rng(1))
    corners = corners_of(PickedSides(frame, SIDES))
    flat = se3.apply(se3.inverse(frame), corners)
    np.testing.assert_allclose(flat, [[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], atol=1e-12)
    assert corners_of(PickedSides(frame, {**SIDES, "top": [(1.0, 0.0)]})) is None
    assert corners_of(PickedSides(frame, {**SIDES, "top": SIDES["right"]})) is None


def test_the_file_is_atoms_and_reads_back(tmp_path):
    frame = se3.random_move(2.0, 1.0, np.random.default_rng(1))
    path = annotation_path(tmp_path, "lidar_1")
    write_picked_sides(path, {"003": PickedSides(frame, {**SIDES, "left": []})})
    document = json.loads(path.read_text())
    assert document["_metadata"]["version"] == "2.0"
    entry = document["003"]
    assert set(entry) == {"plane", "top", "right", "bottom", "left", "intersections"}
    normal = np.array([entry["plane"][k] for k in "ABC"])
    assert normal @ frame[:3, 3] + entry["plane"]["D"] == pytest.approx(0.0, abs=1e-12)
    assert np.array(entry["top"]["picked_pts"]).shape == (3, 2)
    ends = np.array([entry["top"]["start"], entry["top"]["end"]])
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(1.5)
    assert entry["intersections"] == {} and entry["left"] == {"picked_pts": [[], [], []]}
    back = read_picked_sides(path)["003"]
    np.testing.assert_allclose(back.sides["right"], SIDES["right"], atol=1e-12)
    assert (
        read_annotations(tmp_path, {"lidar_1": SimpleNamespace(camera=None)}, ["a", "b"]) == {}
    )  # no pixels of a camera
    path.write_text('{"003": {"plane": {}}}')
    with pytest.raises(DatasetError, match="not a file of picked borders"):
        read_picked_sides(path)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Return a dataset of a camera and a LiDAR that stands wrong, and the true one."""
    scene = scenes.random_scene(4, rgb=1, depth=0, lidar3d=1, collections=4, noise=Noise.none())
    true = scene.truth.edges[scene.dataset.sensors["lidar_1"].edge]
    off = se3.random_move(0.05, 0.05, np.random.default_rng(0))
    edge = {scene.dataset.sensors["lidar_1"].edge: true @ off}
    wrong = scene.dataset.with_transforms(dict.fromkeys(scene.dataset.collections, edge))
    folder = tmp_path_factory.mktemp("data")
    return write_dataset_folder(wrong, folder, name="wrong"), scene


def picking(path, **options):
    usual = {"sensor": "lidar_1", "pattern": "pattern_1", "collection_selection_function": None}
    return Picking(Namespace(dataset=path, point_size=3, window_width=800, **{**usual, **options}))


def test_a_click_picks_the_nearest_point_and_a_right_click_gives_it_back(data):
    path, _ = data
    window = picking(path)
    assert window.title.endswith("top side")
    shown = window.picture()
    assert shown.shape[1] <= 801 and shown.shape[0] <= 481 and shown.any()
    green = np.argwhere(np.all(shown == (20, 200, 100), axis=2))
    row, column = green[len(green) // 2]
    window.click((int(column), int(row)))
    (point,) = window.border.picked["top"]
    assert np.any(np.all(np.isclose(window.border.face.points, point), axis=1))
    assert np.any(window.picture() != shown)
    window.click((int(column), int(row)))
    assert len(window.border.picked["top"]) == 1  # the same point again
    window.right_click()
    assert window.border.picked["top"] == []
    assert window.press("l").save is False and window.title.endswith("left side")
    first = window.title
    assert window.press(".").save and window.title != first
    assert window.press("s").end and window.press("h").help


def pick_true_corners(path, scene, start=0):
    """Write the file that a careful person would, beginning at another corner than the board's."""
    dataset, sides = scene.dataset, list(SIDES)
    picked = {}
    board = dataset.patterns["pattern_1"]
    for key, collection in dataset.collections.items():
        if ("lidar_1", "pattern_1") not in collection.labels:
            continue
        truth = scene.dataset.with_transforms({key: scene.truth.edges})
        edge = {board_edge(board): scene.truth.boards[("pattern_1", key)]}
        truth = truth.with_transforms({key: edge})
        lidar = dataset.sensors["lidar_1"].frame
        frame = pose(truth.collections[key], truth.graph, lidar, board.frame)
        corners = board.border.corners
        ends = [corners[[i, (i + 1) % 4]] for i in range(4)]  # top, right, bottom, left
        named = {sides[(i + start) % 4]: [tuple(p) for p in pair] for i, pair in enumerate(ends)}
        picked[key] = PickedSides(frame, named)
    write_picked_sides(annotation_path(path.parent, "lidar_1"), picked)


@pytest.mark.parametrize(("method", "start"), [("icp_based", 1), ("closed_form", 0)])
def test_true_corners_make_the_true_transform(method, start, data, tmp_path, capsys):
    path, scene = data
    pick_true_corners(path, scene, start)
    target = tmp_path / "out.json"
    line = ["dahll2017", "-d", str(path), "-c", "rgb_1", "-l", "lidar_1", "-p", "pattern_1"]
    assert cli.main([*line, "-mn", method, "-o", str(target), "-nig", "0.1", "0.1"]) == 0
    assert "corners are 0.0 mm apart" in capsys.readouterr().out
    found, true = (
        read_dataset(target),
        scene.dataset.with_transforms(dict.fromkeys(scene.dataset.collections, scene.truth.edges)),
    )
    frames = [true.sensors[name].frame for name in ("rgb_1", "lidar_1")]
    poses = [pose(d.collections["000"], d.graph, *frames) for d in (found, true)]
    np.testing.assert_allclose(*poses, atol=2e-4)


def test_corners_that_are_named_otherwise_do_not_fit_and_it_is_said(data, tmp_path, capsys):
    path, scene = data
    pick_true_corners(path, scene, start=1)
    line = ["dahll2017", "-d", str(path), "-c", "rgb_1", "-l", "lidar_1", "-p", "pattern_1"]
    assert cli.main([*line, "-mn", "closed_form", "-o", str(tmp_path / "o.json")]) == 1
    assert "the corners do not fit" in capsys.readouterr().err


def test_what_is_absent_is_refused(data, monkeypatch, capsys):
    path, _ = data
    for options, says in (
        ({"sensor": "rgb_1"}, "there is no 3D LiDAR 'rgb_1'; there are: lidar_1"),
        ({"pattern": "x"}, "there is no pattern 'x'"),
    ):
        with pytest.raises(DatasetError, match=says):
            picking(path, **options)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    line = ["-d", str(path), "-s", "lidar_1", "-p", "pattern_1"]
    assert cli.main(["annotate_pattern_borders_in_lidar", *line]) == 2
    assert "no screen" in capsys.readouterr().err
    file = annotation_path(path.parent, "lidar_1")
    if file.exists():
        file.unlink()
    assert (
        cli.main(["dahll2017", *line[:2], "-c", "rgb_1", "-l", "lidar_1", "-p", "pattern_1"]) == 2
    )
    assert "pick them with annotate_pattern_borders_in_lidar" in capsys.readouterr().err
