"""Published layouts of hand-eye data: what is written is read back, and calibrates."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402
from hand_eye_layouts import (  # noqa: E402
    CAMERA,
    FLANGE,
    from_layout,
    made_layouts,
    to,
    world_T_flange,
)

from atom_core import cli  # noqa: E402
from atom_core.errors import DatasetError  # noqa: E402
from atom_core.geometry import se3  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.hand_eye_folders import (  # noqa: E402
    numbered_images,
    read_rwhe_folder,
    read_tabb_folder,
)
from atom_core.io.robot_poses import read_rwhe_poses, read_tabb_poses, rwhe_text, tabb_text  # noqa: E402
from atom_core.model.dataset import pose  # noqa: E402
from atom_core.model.truth import with_truth  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with a dataset of a camera on an arm, its configuration, and the scene."""
    return made_layouts(tmp_path_factory.mktemp("made"))


@pytest.mark.parametrize("layout", ["rwhe", "tabb"])
def test_there_and_back(made, tmp_path, layout, capsys):
    """Poses to the last digit but one; images byte by byte; corners found anew where they were."""
    folder, scene = made
    run(*from_layout(folder, layout, tmp_path / "new"))
    assert "boards found in 7 of 7 images" in capsys.readouterr().out
    old, new = scene.dataset, read_dataset(tmp_path / "new" / "dataset.json")
    for wanted, found in zip(world_T_flange(old), world_T_flange(new)):
        np.testing.assert_allclose(found, wanted, atol=1e-12)
    for before, after in zip(old.collections, new.collections):
        name = new.document["collections"][after]["data"][CAMERA]["data_file"]
        copied = (tmp_path / "new" / name).read_bytes()
        assert copied == (folder / "data" / f"{CAMERA}_{before}.jpg").read_bytes()
        a, b = (
            d.collections[k].labels[CAMERA, "pattern_1"] for d, k in ((old, before), (new, after))
        )
        both = np.intersect1d(a.ids, b.ids)
        assert len(both) > 0.8 * len(a.ids)
        one, other = (x.pixels[np.searchsorted(x.ids, both)] for x in (a, b))
        assert np.max(np.abs(one - other)) < 0.5
    found, wanted = (d.sensors[CAMERA].camera.K for d in (new, old))
    np.testing.assert_allclose(found, wanted, rtol=0.02, atol=1e-9)


def test_what_was_converted_calibrates(made, tmp_path):
    """From a camera of which nothing is known: with its intrinsics the edge is right to 1 mm."""
    pytest.importorskip("atom_core._core", reason="calibrates")
    folder, scene = made
    camera = scene.dataset.sensors[CAMERA].camera
    document = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_matrix": {"data": camera.K.ravel().tolist()},
        "distortion_model": camera.model,
        "distortion_coefficients": {"data": camera.D.tolist()},
    }
    (tmp_path / "camera.yaml").write_text(json.dumps(document))
    new = tmp_path / "new"
    run(*from_layout(folder, "rwhe", new, "--camera_info", CAMERA, tmp_path / "camera.yaml"))
    assert (
        cli.main(["calibrate", "-json", str(new / "dataset.json"), "-o", str(tmp_path / "r")]) < 2
    )
    solved = read_dataset(tmp_path / "r" / "atom_calibration.json")
    frame = scene.dataset.sensors[CAMERA].frame
    true = with_truth(scene.dataset, scene.truth)
    wanted, found = (
        pose(next(iter(d.collections.values())), d.graph, FLANGE, frame) for d in (true, solved)
    )
    error = se3.inverse(wanted) @ found
    assert np.linalg.norm(error[:3, 3]) < 1e-3
    assert se3.rotation_angle(error[:3, :3]) < np.radians(0.05)


def test_what_is_beside_the_images(made):
    folder, scene = made
    pattern = scene.dataset.patterns["pattern_1"]
    assert (folder / "rwhe" / "squaresize.txt").read_text() == f"{pattern.square_m:g}m\n"
    stored = loadmat(str(folder / "rwhe" / "RobotPoses.mat"))["handposes"]
    poses = world_T_flange(scene.dataset)
    np.testing.assert_allclose(stored, [p.ravel() for p in poses], atol=1e-12)
    label = scene.dataset.collections["003"].labels[CAMERA, "pattern_1"]
    corners = np.loadtxt(folder / "rwhe" / "detections" / "003.txt")
    np.testing.assert_array_equal(corners, label.pixels)
    words = (folder / "tabb" / "calibration_object.txt").read_text().split()
    board = dict(zip(words[::2], words[1::2]))
    assert board["chess_height"] == str(pattern.rows) and board["chess_width"] == str(
        pattern.columns
    )
    assert float(board["chess_mm_width"]) == pytest.approx(1e3 * pattern.square_m)
    assert float((folder / "tabb" / "robot_cali.txt").read_text().split()[0]) == len(poses)
    hand_T_base_mm = np.loadtxt(folder / "tabb" / "robot_cali.txt", skiprows=1)[:4]
    hand_T_base_mm[:3, 3] /= 1e3
    np.testing.assert_allclose(hand_T_base_mm @ poses[0], np.eye(4), atol=1e-12)


def test_poses_are_read_with_tabs_and_few_digits(tmp_path):
    rng = np.random.default_rng(0)
    poses = [se3.random_move(1.0, 2.0, rng) for _ in range(5)]
    rounded = tmp_path / "a.txt"
    rows = ["\t".join(f"{value:.5f}" for value in pose.ravel()) for pose in poses]
    rounded.write_text("\n".join(rows) + "\n\n")
    for found, wanted in zip(read_rwhe_poses(rounded), poses):
        np.testing.assert_allclose(found, wanted, atol=2e-5)
        np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-12)
    exact = tmp_path / "b.txt"
    for read, text in ((read_rwhe_poses, rwhe_text), (read_tabb_poses, tabb_text)):
        exact.write_text(text(poses))
        np.testing.assert_allclose(read(exact), poses, atol=1e-13)
        exact.write_bytes(("\ufeff" + text(poses)).replace("\n", "\r\n").encode())
        np.testing.assert_allclose(read(exact), poses, atol=1e-13)


@pytest.mark.parametrize(
    "read, text, factor, words",
    [
        (read_rwhe_poses, rwhe_text, 1000.0, "seem to be in millimetres; write them in metres"),
        (read_tabb_poses, tabb_text, 0.001, "seem to be in metres; write them in millimetres"),
    ],
)
def test_poses_in_the_other_ones_unit_are_refused(tmp_path, read, text, factor, words):
    """A real arm's, in mm before RWHE's metres: a camera 97 m off, and its labels were blamed."""
    poses = [se3.transform(np.eye(3), np.array([0.5, 0.1 * i, 0.6])) for i in range(3)]
    for one in poses:
        one[:3, 3] *= factor
    path = tmp_path / "poses.txt"
    path.write_text(text(poses))
    with pytest.raises(DatasetError, match=words):
        read(path)


def test_images_belong_to_the_line_of_their_number(made, tmp_path):
    """As many images as lines: in their order. Fewer: image n to line n."""
    folder, scene = made
    shutil.copytree(folder / "rwhe", tmp_path / "rwhe")
    poses = world_T_flange(scene.dataset)
    images = tmp_path / "rwhe"
    (images / "2.jpg").unlink()
    found = read_rwhe_folder(images, CAMERA)
    assert list(found.base_T_hand) == [1, 3, 4, 5, 6, 7]
    np.testing.assert_allclose(found.base_T_hand[5], poses[4], atol=1e-12)
    (images / "7.jpg").rename(images / "abc0.jpg")
    with pytest.raises(DatasetError, match="none for image 0"):
        read_rwhe_folder(images, CAMERA)
    shutil.copy(images / "6.jpg", images / "x6b44.jpg")
    assert list(numbered_images(images)) == [0, 1, 3, 4, 5, 6, 44]
    in_order = read_rwhe_folder(images, CAMERA)
    np.testing.assert_allclose(in_order.base_T_hand[44], poses[6], atol=1e-12)


def test_what_does_not_belong_together_is_refused(made, tmp_path, capsys):
    folder, _ = made
    for name in ("rwhe", "tabb"):
        shutil.copytree(folder / name, tmp_path / name)
    shutil.copy(folder / "config.yml", tmp_path / "config.yml")
    line = from_layout(tmp_path, "rwhe", tmp_path / "new")
    poses = tmp_path / "rwhe" / "RobotPosesVec.txt"
    rows = poses.read_text().splitlines()
    for text, words in (
        ("\n".join(rows[:3]), "has 3 lines, and none for image"),
        ("\n".join([*rows[:6], " ".join(rows[6].split()[:7])]), "16 of a pose"),
        ("\n".join([*rows[:6], "1 " * 16]), "is no pose"),
        ("\n".join([*rows[:6], "a" + rows[6]]), "what is no number"),
        ("", "holds no pose"),
    ):
        poses.write_text(text)
        assert words in refused(capsys, *line)
    poses.unlink()
    assert "cannot be read" in refused(capsys, *line)
    tabb = tmp_path / "tabb" / "robot_cali.txt"
    tabb.write_text(tabb_text([np.eye(4)] * 6))
    assert "6 poses for 7 numbers" in refused(
        capsys, *from_layout(tmp_path, "tabb", tmp_path / "n")
    )
    wrong = ["-e", "rgb_9", "-sf", "world", "-tf", FLANGE]
    assert "no camera 'rgb_9'" in refused(
        capsys, "convert_to_rwhe_dataset", *to(folder, tmp_path / "x"), *wrong
    )
    assert "frame 'ee_link'" in refused(
        capsys, "convert_to_tabb_dataset", *to(folder, tmp_path / "x")
    )
    assert not (tmp_path / "new").exists() and not (tmp_path / "x").exists()


def test_frames_that_the_poses_do_not_connect_are_refused(made, tmp_path, capsys):
    folder, _ = made
    line = from_layout(folder, "rwhe", tmp_path / "new", "-hl", "gripper")
    assert "has the parent_link 'flange'" in refused(capsys, *line)


def test_images_keep_their_poses_whatever_the_collections_are_called(made, tmp_path):
    """Numbers within names were taken for their order: three of nine images got other poses."""
    folder, scene = made
    names = ["b1", "a1", "c20", "a3", "x", "b7", "a07"]
    shutil.copytree(folder / "data", tmp_path / "data")
    path = tmp_path / "data" / "dataset.json"
    document = json.loads(path.read_text())
    for part in (document, *document["patterns"].values()):
        key = "collections" if "collections" in part else "transforms_initial"
        part[key] = dict(zip(names, part[key].values()))
    path.write_text(json.dumps(document))
    run("convert_to_tabb_dataset", *to(tmp_path, "tabb"), "-hl", FLANGE)
    images = dict(zip(contents_of_images(folder / "data"), world_T_flange(scene.dataset)))
    read = read_tabb_folder(tmp_path / "tabb")
    assert len(read.base_T_hand) == len(names)
    for number, found in read.base_T_hand.items():
        wanted = images[read.images[CAMERA][number].read_bytes()]
        np.testing.assert_allclose(found, wanted, atol=1e-12)


def contents_of_images(data):
    """Return the content of the images of a dataset's folder, in the order of its collections."""
    return [path.read_bytes() for path in sorted(data.glob(f"{CAMERA}_*.jpg"))]


@pytest.mark.parametrize(
    "text, sides_m",
    [
        ("60mm", (0.06,)),
        ("0.06m\n", (0.06,)),
        ("0.06", (0.06,)),
        ("60", (0.06,)),
        ("6 cm\r\n", (0.06,)),
        ("sixty", None),
        (".", None),
        ("-3", None),
        ("", None),
    ],
)
def test_the_square_of_a_folder_is_read_with_its_unit(made, tmp_path, text, sides_m):
    folder = tmp_path / "rwhe"
    shutil.copytree(made[0] / "rwhe", folder)
    (folder / "squaresize.txt").write_text(text)
    board = read_rwhe_folder(folder, CAMERA).board
    assert (None if board is None else board.sides_m) == sides_m


@pytest.mark.parametrize(
    "layout, name, old, new, words",
    [
        ("rwhe", "squaresize.txt", "0.06m", "0.0625m", "squares of 62.5 mm, and in"),
        ("tabb", "calibration_object.txt", "width 60", "width 61", "squares of 60 x 61 mm"),
        ("tabb", "calibration_object.txt", "width 11", "width 12", "8 x 12 inner corners"),
        ("tabb", "calibration_object.txt", "width 60", "width 60.01", None),
        ("tabb", "calibration_object.txt", "chess_", "board_", None),
    ],
)
def test_a_board_that_is_another_one_beside_the_images_is_told(
    made, tmp_path, capsys, layout, name, old, new, words
):
    folder, _ = made
    shutil.copytree(folder / layout, tmp_path / layout)
    shutil.copy(folder / "config.yml", tmp_path / "config.yml")
    file = tmp_path / layout / name
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    run(*from_layout(tmp_path, layout, tmp_path / "new"))
    said = capsys.readouterr().out
    assert (f"warning: {file}: " in said) == (words is not None)
    if words is not None:
        assert words in said and "'pattern_1' has 60 mm, 11 x 8; correct what is wrong" in said


@pytest.mark.parametrize("layout", ["rwhe", "tabb"])
@pytest.mark.parametrize("inverted", [False, True])
def test_poses_that_the_images_fit_inverted_are_told(made, tmp_path, capsys, layout, inverted):
    """`calibrate` called the answer wrong, and had the arm's own calibration looked at."""
    folder, _ = made
    shutil.copytree(folder / layout, tmp_path / layout)
    shutil.copy(folder / "config.yml", tmp_path / "config.yml")
    name, read, text = {
        "rwhe": ("RobotPosesVec.txt", read_rwhe_poses, rwhe_text),
        "tabb": ("robot_cali.txt", read_tabb_poses, tabb_text),
    }[layout]
    if inverted:
        path = tmp_path / layout / name
        path.write_text(text([se3.inverse(one) for one in read(path)]))
    run(*from_layout(tmp_path, layout, tmp_path / "new"))
    said = f"the robot's poses are inverted, by the images of '{CAMERA}'"
    assert (said in capsys.readouterr().out) == inverted


@pytest.mark.parametrize("layout", ["rwhe", "tabb"])
def test_images_of_an_earlier_conversion_do_not_stay_beside_those_of_this(
    made, tmp_path, layout, capsys
):
    """Programs pair images and poses in their order, and take all that lie there."""
    folder, _ = made
    output = tmp_path / "out"
    words = [f"convert_to_{layout}_dataset", *to(folder, output)]
    frames = {"rwhe": ["-e", CAMERA, "-sf", "world", "-tf", FLANGE, "-sd"], "tabb": ["-hl", FLANGE]}
    words += frames[layout]
    run(*words)
    run(*words, "-ow")
    before = {path: path.read_bytes() for path in output.rglob("*") if path.is_file()}
    line = refused(capsys, *words, "-ow", "-csf", "!000")
    assert "of another conversion" in line
    assert before == {path: path.read_bytes() for path in output.rglob("*") if path.is_file()}


@pytest.mark.parametrize("layout", ["rwhe", "tabb"])
def test_a_dataset_is_not_put_among_the_images_that_it_is_made_of(made, layout, capsys):
    folder, _ = made
    images = folder / layout if layout == "rwhe" else folder / layout / "images" / CAMERA
    before = sorted(images.iterdir())
    assert "the images themselves" in refused(capsys, *from_layout(folder, layout, images, "-ow"))
    assert sorted(images.iterdir()) == before
