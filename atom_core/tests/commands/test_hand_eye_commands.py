"""ATOM's commands for cameras by themselves, between collections, and its hand-eye baselines."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core import cli
from atom_core.commands.hand_eye_baseline import TOOLS
from atom_core.geometry.pose_solvers import lacking
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import DataSource
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.arm import camera_on_arm
from atom_core.synthetic.carried import on_tilting_head

# From a base on, which the camera faces, OpenCV's are wrong by metres, also without noise.
FAIL_TO_HAND = ("tsai", "horaud", "daniilidis")
MOVED = {True: scenes.hand_eye, False: scenes.board_on_arm}  # the camera, or the board


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Return datasets without noise whose transforms are true, by whether the camera moves."""
    folder = tmp_path_factory.mktemp("hand_eye")
    paths = {}
    for camera_moves, scene in MOVED.items():
        exact = scene(0, collections=6, noise=Noise.none()).dataset
        paths[camera_moves] = write(exact, folder / str(camera_moves))
    return paths


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Return a dataset of a camera that is a little off, and what `evaluate` says of it."""
    folder = tmp_path_factory.mktemp("evaluated")
    scene = scenes.hand_eye(3, collections=6, disturbance=(0.005, 0.005))
    path = write(scene.dataset, folder / "data")
    assert run("evaluate", "--train", path, "--test", path, "--output", folder / "all") == 0
    return path, json.loads((folder / "all" / "evaluation.json").read_text())


def write(dataset, folder):
    """Write a dataset without its pictures, which nothing here needs."""
    return write_dataset_folder(replace(dataset, data=DataSource()), folder, name="arm")


def run(*words):
    return cli.main([str(word) for word in words])


def solve(name, path, target, *more):
    usual = ["-c", "rgb_1", "-p", "pattern_1", "-o", target]
    return run(name, "-json", path, *usual, *more)


def table(path):
    return list(csv.reader(path.read_text().splitlines()))


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", TOOLS)
def test_each_tool_finds_the_truth_and_says_so(name, data, tmp_path, capsys):
    tool = TOOLS[name]
    if lacking(tool.methods[0]):
        assert solve(name, data[tool.camera_moves], tmp_path / "a.json") == 2
        assert lacking(tool.methods[0]) in capsys.readouterr().err
        return
    methods = [m for m in tool.methods if tool.camera_moves or m not in FAIL_TO_HAND]
    frames = {True: ("flange", "world"), False: ("flange", "rig_base")}[tool.camera_moves]
    for method in methods:
        more = ["-mn", method, "-hl", frames[0], "-bl", frames[1], "-ctgt", "-si"]
        target = tmp_path / f"{method}.json"
        assert solve(name, data[tool.camera_moves], target, *more) == 0
        told = capsys.readouterr()
        assert "note: -si has no meaning here, because" in told.err
        assert "Errors against the dataset's own transforms" in told.out
        true, found = read_dataset(data[tool.camera_moves]), read_dataset(target)
        edge = true.sensors["rgb_1"].edge
        np.testing.assert_allclose(found.first_value(edge), true.first_value(edge), atol=1e-5)


@pytest.mark.skipif(bool(lacking("tsai")), reason="this OpenCV has no calibrateHandEye")
def test_an_answer_that_is_wrong_by_far_is_called_wrong(data, tmp_path, capsys):
    """Where OpenCV's method finds one at all; which fail depends on the turns."""
    said = {}
    for method in FAIL_TO_HAND:
        target = tmp_path / f"{method}.json"
        more = ["-mn", method, "-hl", "flange", "-bl", "rig_base"]
        code = solve("cv_eye_to_hand", data[False], target, *more)
        said[method] = capsys.readouterr().err
        found = read_dataset(target) if target.exists() else None
        true = read_dataset(data[False])
        edge = true.sensors["rgb_1"].edge
        right = found is not None and np.allclose(
            found.first_value(edge), true.first_value(edge), atol=1e-3
        )
        assert (code == 0) == right, said[method]
        assert right or "is wrong: its corners are" in said[method] or "finds no" in said[method]
    assert any("is wrong: its corners are" in text for text in said.values())


@pytest.mark.skipif(bool(lacking("park")), reason="this OpenCV has no calibrateHandEye")
def test_an_answer_is_called_wrong_where_no_method_explains_the_corners(data, tmp_path, capsys):
    """Each image has the pose of another one."""
    exact = read_dataset(data[True])
    keys, arm = list(exact.collections), Edge("rig_base", "flange")
    mixed = {
        key: {arm: exact.collections[other].transforms[arm]}
        for key, other in zip(keys, [*keys[2:], *keys[:2]])
    }
    path = write(exact.with_transforms(mixed), tmp_path / "mixed")
    assert solve("cv_eye_in_hand", path, tmp_path / "a.json", "-mn", "park") == 1
    told = capsys.readouterr().err
    assert "is wrong, and no method has a right one: with that of" in told and told.count("\n") == 1


@pytest.mark.skipif(bool(lacking("park")), reason="this OpenCV has no calibrateHandEye")
def test_a_camera_on_a_tilting_head_is_solved(data, tmp_path, capsys):
    exact = on_tilting_head(read_dataset(data[True]), "rgb_1", [0.1, 0.4, -0.3, 0.2, 0.0, -0.2])
    path, target = write(exact, tmp_path / "tilting"), tmp_path / "a.json"
    assert solve("cv_eye_in_hand", path, target, "-mn", "park", "-hl", "flange") == 0
    assert "rgb_1_link in flange" in capsys.readouterr().out
    edge = exact.sensors["rgb_1"].edge
    np.testing.assert_allclose(
        read_dataset(target).first_value(edge), exact.first_value(edge), atol=1e-5
    )


def test_any_frame_of_the_hand_and_of_the_base_gives_the_same(data, tmp_path):
    """In the camera's own parent or farther up; the board's side likewise."""
    found = []
    for i, bl in enumerate(("rig_base", "world")):
        target = tmp_path / f"{i}.json"
        assert solve("cv_eye_in_hand", data[True], target, "-mn", "park", "-bl", bl) == 0
        dataset = read_dataset(target)
        found.append(dataset.first_value(dataset.sensors["rgb_1"].edge))
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


def test_the_file_has_atom_s_name_and_is_not_replaced_unasked(data, capsys):
    line = ("cv_eye_in_hand", "-json", data[True], "-c", "rgb_1", "-p", "pattern_1", "-mn", "park")
    assert run(*line, "-ctgt", "-sfr") == 0
    assert (data[True].parent / "hand_eye_park_rgb_1.json").is_file()
    written = table(data[True].parent / "cv_eye_in_hand_results.csv")
    assert written[0] == ["Transform", "Et [m]", "Erot [rad]"]
    assert written[1][0] == "flange-rgb_1_link" and float(written[1][1]) < 1e-5
    capsys.readouterr()
    assert run(*line) == 2 and "exists already" in capsys.readouterr().err
    assert run(*line, "-ow") == 0


def test_a_disturbed_robot_disturbs_the_answer(tmp_path, capsys):
    exact = camera_on_arm(0, errors={}, collections=6, noise=Noise.none()).dataset
    path = write(exact, tmp_path / "arm")
    bias = ["-jbn", "elbow", "-jbp", "position_bias", "-jbv", "0.02"]
    errors = []
    for more in ([], bias):
        table_file = tmp_path / f"{len(more)}.csv"
        words = ["-mn", "park", "-ctgt", "-sfrn", table_file, *more]
        assert solve("cv_eye_in_hand", path, tmp_path / f"{len(more)}.json", *words) == 0
        errors.append(float(table(table_file)[1][1]))
    assert errors[0] < 1e-5 and errors[1] > 1e-3
    assert solve("cv_eye_in_hand", path, tmp_path / "c.json", *bias[:4]) == 2
    assert "go together" in capsys.readouterr().err


@pytest.mark.parametrize(
    "more, words",
    [
        (["-mn", "shah"], "has no such method; use tsai, park"),
        (["-hl", "nowhere"], "frame 'nowhere' is in no transform"),
        (["-hl", "world"], "frame 'world' moves against 'flange'"),
        (["-csf", "000", "001"], "in 2 collections"),
        (["-sfr"], "add -ctgt"),
        (["-c", "rgb_9"], "there is no rgb camera 'rgb_9'"),
        (["-p", "other"], "there is no pattern 'other'"),
    ],
)
def test_what_cannot_be_solved_is_refused_in_one_line(data, tmp_path, capsys, more, words):
    assert solve("cv_eye_in_hand", data[True], tmp_path / "a.json", *more) == 2
    lines = capsys.readouterr().err.splitlines()
    (error,) = (line for line in lines if ": note: " not in line)  # of an option that stands twice
    assert words in error
    assert not (tmp_path / "a.json").exists()


def test_a_camera_by_itself_in_atom_s_columns(evaluated, capsys):
    path, document = evaluated
    (wanted,) = document["single_cameras"]
    line = ("single_rgb_evaluation", "-train_json", path, "-test_json", path)
    assert run(*line, "-sfr") == 0
    header, *rows = table(path.parent / "results" / "dataset_rgb_results.csv")
    assert header == ["Collection", "rgb_1-pattern_1 [px]", "all [px]"]
    found = {row[0]: float(row[1]) for row in rows}
    means = {key: figures["mean"] for key, figures in wanted["per_collection"].items()}
    assert found.pop("Averages") == pytest.approx(np.mean(list(means.values())), abs=6e-5)
    assert found == pytest.approx(means, abs=6e-5)
    assert all(row[1] == row[2] for row in rows)
    capsys.readouterr()
    assert run(*line, "-sfr") == 2 and "exists already" in capsys.readouterr().err


def test_the_board_of_the_train_file_on_demand(data, evaluated, tmp_path, capsys):
    """It is where the method saw it; a raw dataset has none."""
    path, _ = evaluated
    line = ("single_rgb_evaluation", "-train_json", path, "-test_json", path, "-cpt")
    assert run(*line) == 2 and "leave -cpt out" in capsys.readouterr().err
    assert solve("cv_eye_in_hand", data[True], tmp_path / "park.json", "-mn", "park") == 0
    line = ("single_rgb_evaluation", "-train_json", tmp_path / "park.json", "-cpt")
    assert run(*line, "-test_json", data[True], "-sfrn", tmp_path / "a.csv") == 0
    assert float(table(tmp_path / "a.csv")[-1][1]) < 0.01


def test_between_collections_in_atom_s_columns(evaluated, tmp_path, capsys):
    path, document = evaluated
    (wanted,) = document["between_collections"]
    line = ["inter_collection_rgb_to_rgb_evaluation", "-train_json", path, "-test_json", path]
    line += ["-ss", "rgb_1", "-st", "rgb_1", "-wf", "world"]
    assert run(*line, "-sfrn", tmp_path / "a.csv") == 0
    header, *rows = table(tmp_path / "a.csv")
    assert header[0] == "Collection #" and header[-2:] == ["Trans (mm)", "Rot (deg)"]
    assert len(rows) == 6 * 5 // 2 + 1
    assert float(rows[-1][4]) == pytest.approx(wanted["translation_mm"], abs=6e-5)
    assert "warning" not in capsys.readouterr().out
    assert run(*line[:-1], "flange") == 0
    told = capsys.readouterr().out
    assert "is fixed in 'world', which moves against 'flange' (-wf) by up to" in told
    assert run(*line[:-1], "nowhere") == 2
    assert "frame 'nowhere' is in no transform" in capsys.readouterr().err


def test_between_collections_of_a_board_that_is_moved_nothing_can_be_said(tmp_path, capsys):
    scene = scenes.two_cameras(0, collections=3)
    path = write(scene.dataset, tmp_path / "two")
    line = ["inter_collection_rgb_to_rgb_evaluation", "-train_json", path, "-test_json", path]
    assert run(*line, "-ss", "rgb_1", "-st", "rgb_2", "-uic") == 2
    error = capsys.readouterr().err
    assert "no pattern is fixed in its parent_link" in error and error.count("\n") == 1
    wrong = ["inter_collection_lidar_to_rgb_evaluation", *line[1:], "-rs", "rgb_1", "-cs", "rgb_2"]
    assert run(*wrong, "-uic") == 2 and "no pair of lidar3d-rgb" in capsys.readouterr().err
