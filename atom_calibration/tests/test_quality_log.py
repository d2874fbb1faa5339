"""The collector tells how well each sensor sees the board, and what to do where labels fail."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from stand_in_rig import messages, position

from atom_calibration.collect.quality import QualityLog
from atom_calibration.labels.board_figures import add_figures
from atom_calibration.modalities.frames import Frame
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.base import Labeled, nothing
from atom_core.model.config import CalibrationConfig
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.board_image import render

CAMERA = Camera(640, 480, np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]]), np.zeros(5))
NEAR_M, FAR_M = 1.2, 5.0  # from the near camera; the far one stands behind it


def sensor_of(name):
    edge = Edge("world", f"{name}_link")
    return Sensor(name, RGB, f"{name}_link", edge, camera=CAMERA, topic=f"/{name}/image")


class Cell:
    """Two cameras before a board: the near one sees it, to the far one it is too small."""

    def __init__(self, make):
        self.said = []
        self.sensors = {name: sensor_of(name) for name in ("near", "far")}
        pattern_config = charuco()
        links = {
            name: {
                "link": s.frame,
                "parent_link": "world",
                "child_link": s.frame,
                "topic_name": s.topic,
                "modality": "rgb",
            }
            for name, s in self.sensors.items()
        }
        self.config = CalibrationConfig.from_document(
            {
                "world_link": "world",
                "sensors": links,
                "calibration_patterns": {"board": pattern_config.to_document()},
            },
            "config",
        )
        self.patterns = {"board": pattern_from_config("board", pattern_config)}
        self.log = QualityLog(self.config, self.sensors, self.patterns, self.said.append)
        behind = np.eye(4)
        behind[2, 3] = NEAR_M - FAR_M
        self.tree = TransformTree()
        for link, pose in (("near_link", np.eye(4)), ("far_link", behind)):
            self.tree.add(make.tf("world", link, pose).transforms, fixed=True)

    def frames(self, stamp_s=1.0, reason="2 marker(s) are seen, 3 are needed"):
        pattern = self.patterns["board"]
        pose = se3.from_rpy(np.zeros(3), np.array([0.3, 0.2, 0.1]))
        middle = np.append(pattern.border.centre, 0.0)
        pose[:3, 3] = [0.0, 0.0, NEAR_M] - pose[:3, :3] @ middle
        config = self.config.calibration_patterns["board"]
        image = render(CAMERA, [((pattern, config), pose)])
        ids = np.arange(pattern.corner_count)
        label = RgbLabel(ids, CAMERA.project(se3.apply(pose, pattern.corners_of(ids))))
        near = Frame(self.sensors["near"], stamp_s, {}, image)
        near.set_label("board", Labeled(label, quality={"corners": float(len(ids))}))
        far = Frame(self.sensors["far"], stamp_s, {}, np.zeros_like(image))
        far.set_label("board", nothing(RGB, reason))
        return {"near": near, "far": far}


@pytest.fixture
def cell(make):
    return Cell(make)


def test_the_second_failure_for_one_reason_brings_advice_with_the_distance(cell):
    cell.log.add("000", cell.frames(), {}, cell.tree)
    assert cell.said == []
    cell.log.add("001", cell.frames(reason="1 marker(s) are seen, 3 are needed"), {}, cell.tree)
    assert len(cell.said) == 1 and cell.said[0].startswith("far: board too small (")
    nearer_m = float(cell.said[0].split("nearer than ")[1].split(" m")[0])
    assert NEAR_M < nearer_m < FAR_M
    cell.log.add("002", cell.frames(), {}, cell.tree)
    assert len(cell.said) == 1 and "(3 collections)" in cell.log.advice()[0]


def test_two_reasons_are_two_matters(cell):
    cell.log.add("000", cell.frames(), {}, cell.tree)
    cell.log.add("001", cell.frames(reason="the image is dark"), {}, cell.tree)
    assert cell.said == [] and cell.log.advice() == []


def test_without_transforms_the_reason_alone_is_told(cell):
    for key in ("000", "001"):
        cell.log.add(key, cell.frames(), {}, None)
    assert cell.said == ["far: 2 marker(s) are seen, 3 are needed (2 collections)"]


def test_a_row_that_no_picture_shows_is_told_once(cell):
    """The board is configured with a row too many, so that its labels lack one."""
    board = cell.patterns["board"]
    for number in range(6):
        frames = cell.frames()
        label = frames["near"].labels["board"].label
        kept = label.ids < board.corner_count - board.columns
        seen = RgbLabel(label.ids[kept], label.pixels[kept])
        frames["near"].set_label("board", Labeled(seen))
        del frames["far"].labels["board"]
        cell.log.add(f"{number:03}", frames, {}, cell.tree)
        assert len(cell.said) == (number >= 4)
    size = f"{board.columns} x {board.rows - 1} inner corners"
    assert "no picture shows a corner of the last row of pattern 'board', though 5" in cell.said[0]
    assert f"the board has {size}" in cell.said[0] and "correct dimension" in cell.said[0]
    cell.log.add("006", cell.frames(), {}, cell.tree)
    assert not cell.log.unseen_rows()


def test_a_collection_that_is_deleted_does_not_count(cell):
    for key in ("000", "001"):
        cell.log.add(key, cell.frames(), {}, cell.tree)
    cell.log.delete("001")
    assert cell.log.advice() == [] and cell.log.of_one("001") == ""


def test_a_collection_is_told_by_what_is_known_of_it(cell):
    cell.log.add("000", cell.frames(), {("near", "board"): 2.0}, cell.tree)
    text = cell.log.of_one("000")
    assert text.startswith("near blur 0.") and f"{NEAR_M} m" in text and "far" not in text
    table = list(cell.log.summary())
    assert "blur [px]" in table[0] and "motion [px/s]" in table[0]
    assert len(table) == 2 and "0.6 (0.6..0.6)" in table[1]


def test_a_smeared_picture_is_named_at_once_with_the_way_that_the_board_moved(cell):
    frames = cell.frames()
    near = frames["near"]
    light = near.data[..., 0].astype(np.float32)
    smeared = cv2.filter2D(light, -1, np.full((1, 9), 1.0 / 9.0, np.float32))
    near.data = np.repeat(np.rint(smeared).astype(np.uint8)[..., None], 3, axis=2)
    cell.log.add("000", {"near": near}, {}, cell.tree)
    (line,) = cell.said
    assert line.startswith("near: the board moved ") and "while the shutter was open" in line
    assert (
        7.0 <= float(line.split("moved ")[1].split(" px")[0]) <= 14.4
    )  # of a ChArUco up to 60 % too long
    assert "hold it still" in line and cell.log.advice() == [line]
    cell.log.delete("000")
    assert cell.log.advice() == []


def test_a_board_that_moved_before_a_sensor_is_named_with_its_speed(cell):
    cell.log.add("000", {"near": cell.frames()["near"]}, {("near", "board"): 1000.0}, cell.tree)
    assert (
        len(cell.said) == 1 and "near: the board moved at 300 px/s: hold it still" in cell.said[0]
    )


def test_figures_stand_beside_those_of_the_labeler(cell):
    frame = cell.frames()["near"]
    add_figures(frame, cell.patterns["board"], cell.config.calibration_patterns["board"])
    quality = frame.labels["board"].quality
    assert quality["corners"] and quality["distance_m"] == pytest.approx(NEAR_M, abs=0.01)
    assert frame.labels["board"].detected and "board" in frame.sightings


def test_cameras_that_see_a_board_mirrored_to_each_other_are_named(cell):
    frames = cell.frames()
    label = frames["near"].labels["board"]
    for name, black in (("near", 1.0), ("far", 0.0)):
        frames[name].set_label("board", replace(label, quality={"starts_black": black}))
    cell.log.add("000", {"near": frames["near"]}, {}, cell.tree)
    assert cell.log.mirrored() == [] and cell.said == []
    cell.log.add("001", frames, {}, cell.tree)
    (line,) = cell.log.mirrored()
    assert line.startswith("the pattern is mirrored: ") and cell.said == [line]
    assert "black to near and white to far" in line


def test_a_sensor_that_chose_among_planes_is_named_at_once(cell):
    frames = cell.frames()
    label = frames["near"].labels["board"]
    frames["near"].set_label("board", replace(label, quality={"planes_alike": 2.0}))
    for key in ("000", "001"):
        cell.log.add(key, {"near": frames["near"]}, {}, cell.tree)
    (line,) = cell.said
    assert line.startswith("near: 2 planes of the board's size are in view") and "(1 coll" in line
    assert "(2 collections)" in cell.log.advice()[0]


def sizes_of(cell, share):
    """Return what is said of a board whose size is a share of the configured one, and by whom."""
    lidar = Sensor("lidar", LIDAR3D, "lidar_link", Edge("world", "lidar_link"))
    log = QualityLog(cell.config, {"lidar": lidar}, cell.patterns, cell.said.append)
    for k, away in enumerate(np.linspace(1.5, 3.5, 8)):
        points = np.array([[away, x, y] for x in (-0.2, 0.0, 0.2) for y in (-0.2, 0.0, 0.2)])
        figures = {"measured_width_m": 0.8 * share + 0.001 * (k % 3)}
        figures["measured_height_m"] = 0.6 * share
        labeled = Labeled(
            RangeLabel(np.arange(9), np.arange(4)), quality=figures, next_seed=points.mean(axis=0)
        )
        cloud = np.rec.fromarrays(points.T, names="x,y,z")
        frame = Frame(lidar, float(k), {}, cloud)
        frame.set_label("board", labeled)
        log.add(f"{k:03d}", {"lidar": frame}, {}, cell.tree)
    lines, smaller = log.sizes(), log.smaller()
    for k in range(8):
        log.delete(f"{k:03d}")
    assert log.sizes() == [] and log.smaller() == []
    return lines, smaller


def test_boards_of_another_size_are_named_and_smaller_ones_are_no_boards(cell):
    ((larger,), none) = sizes_of(cell, 1.05)
    assert "looks 0.841 m wide and 0.630 m high to sensor 'lidar'" in larger and none == []
    ((smaller,), sensors) = sizes_of(cell, 0.95)
    assert "looks 0.761 m wide and 0.570 m high" in smaller and sensors == ["lidar"]
    assert sizes_of(cell, 0.985) == ([], [])


# ------------------------------------------------------------------------------ from a bag


def test_the_summary_and_a_file_tell_how_well_each_sensor_sees_the_board(place, capsys):
    assert main(place()) == 0
    said = capsys.readouterr().out
    assert "distance [m]" in said and "motion [mm/s]" in said and "advice" not in said
    document = json.loads((place.folder / "quality.json").read_text())
    assert list(document["collections"]) == ["000", "001", "002"] and document["advice"] == []
    for number, key in enumerate(document["collections"]):
        figures = document["collections"][key]["lidar"]["board"]
        assert figures["distance_m"] == pytest.approx(3 + 0.05 * position(2.5 * number), abs=0.15)
        assert figures["speed_mm_s"] < 20.0  # it stands still
    assert "quality" not in (place.folder / "dataset.json").read_text()


def test_labels_that_fail_twice_for_one_reason_are_told_once_with_advice(place, make, capsys):
    content = list(messages(make))
    for topic, message, time_s in content:
        if topic == "/cam/image_raw" and time_s > 102.3:  # all but the first stop
            message.data = bytes(len(message.data))
    assert main(place(content)) == 0
    said = capsys.readouterr()
    assert said.err.count("warning: cam: no markers (2 collections)") == 1
    assert "advice: cam: no markers (2 collections)" in said.out
    document = json.loads((place.folder / "quality.json").read_text())
    assert document["advice"] == ["cam: no markers (2 collections)"]
    label = document["collections"]["002"]["cam"]["board"]
    assert label == {"detected": False, "reason": "no markers"}


def test_a_board_that_never_rests_is_warned_of_where_the_stamps_are_equal(
    place, capsys, monkeypatch
):
    monkeypatch.setattr("stand_in_rig.position", lambda time_s: 1 + int(round(100.0 * time_s)))
    one_stop = messages(place.make, lag_s=0.0, stops=1)
    main([*place(one_stop), "--interval", "0.5"])
    said = capsys.readouterr()
    assert "warning: cam: the board moved at 1" in said.out + said.err
    assert any("px/s: hold it still" in line for line in said.out.split("\n") if "advice" in line)
