"""ATOM's two evaluations against the truth show what the transforms were shifted by."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from atom_core import cli
from atom_core.geometry import se3
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.config import EdgeConfig
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.degenerate import planar_motion

SHIFT, TURN = np.array([0.003, -0.002, 0.006]), np.array([0.01, -0.02, 0.005])
MOVE = se3.transform(se3.rotation_from_rotation_vector(TURN), SHIFT)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a true dataset, one whose second camera is shifted, and the camera's edge."""
    folder = tmp_path_factory.mktemp("truth")
    true = scenes.two_cameras(0, collections=3, noise=Noise.none()).dataset
    edge = true.sensors["rgb_2"].edge
    shifted = true.first_value(edge) @ se3.inverse(MOVE)
    found = true.with_transforms(dict.fromkeys(true.collections, {edge: shifted}))
    write_dataset_folder(true, folder / "true", name="true")
    write_dataset_folder(found, folder / "found", name="found")
    return folder, edge


def run(kind, folder, *words, code=0):
    files = ["-train_json", folder / "found" / "dataset.json"]
    files += ["-test_json", folder / "true" / "dataset.json", *words]
    line = [f"ground_truth_{kind}_evaluation", *(str(word) for word in files)]
    assert cli.main(line) == code


def table(path):
    header, *rows = csv.reader(path.read_text().splitlines())
    return header, {row[0]: [float(value) for value in row[1:]] for row in rows}


def test_frames(made, tmp_path):
    folder, edge = made
    run("frame", folder, "-sfrn", tmp_path / "all.csv")
    header, rows = table(tmp_path / "all.csv")
    assert header[:3] == ["Transformation #", "Trans (m)", "Rot (rad)"] and len(header) == 9
    wanted = [np.linalg.norm(SHIFT), np.linalg.norm(TURN), *np.abs(SHIFT), *np.abs(TURN)]
    assert rows[f"world-{edge.child}"] == pytest.approx(wanted, abs=6e-5)
    others = [row for name, row in rows.items() if name not in (f"world-{edge.child}", "Averages")]
    assert len(others) == 1 and others[0] == [0.0] * 8
    assert rows["Averages"] == pytest.approx(np.array(wanted) / 2, abs=6e-5)


def test_one_frame_by_collection(made, tmp_path, capsys):
    folder, edge = made
    run("frame", folder, "-sf", edge.child, "-tf", edge.parent, "-sfrn", tmp_path / "one.csv")
    header, rows = table(tmp_path / "one.csv")
    assert header[0] == "Collection #" and list(rows) == ["000", "001", "002", "Averages"]
    assert rows["001"][2:5] == pytest.approx(SHIFT, abs=6e-5)
    assert rows["Averages"][2:5] == pytest.approx(np.abs(SHIFT), abs=6e-5)
    run("frame", folder, "-sf", "nowhere", code=2)
    assert "frame 'nowhere'" in capsys.readouterr().err


def test_a_transform_is_signed_the_other_way(made, tmp_path, capsys):
    """Found seen from true: for ATOM that of a transform, unlike that of a frame."""
    folder, edge = made
    run("transform", folder, "-p", edge.parent, "-c", edge.child, "-sfrn", tmp_path / "t.csv")
    _, rows = table(tmp_path / "t.csv")
    move = se3.inverse(se3.transform(se3.rotation_from_rotation_vector(TURN), SHIFT))
    angles = se3.rpy_from_rotation(move[:3, :3])
    assert rows["Averages"][2:] == pytest.approx([*move[:3, 3], *angles], abs=6e-5)
    capsys.readouterr()
    run("transform", folder, "-p", edge.parent, "-c", edge.child)
    means = capsys.readouterr().out
    assert "Averages" in means and "\n001  " not in means
    run("transform", folder, "-p", edge.parent, "-c", edge.child, "-sac")
    assert "\n001  " in capsys.readouterr().out


def test_frames_between_which_nothing_is_calibrated_are_told(made, capsys):
    """Their zeros looked like a perfect calibration."""
    folder, edge = made
    told = "nothing that is calibrated lies between"
    behind = "rgb_2_optical_frame"
    for kind, words, is_told in (
        ("transform", ["-p", edge.child, "-c", behind], True),
        ("transform", ["-p", edge.parent, "-c", behind], False),
        ("frame", ["-sf", edge.parent], True),
        ("frame", ["-sf", edge.child], False),
        ("frame", [], False),
    ):
        run(kind, folder, *words)
        assert (told in capsys.readouterr().out) == is_told


def test_another_truth_and_none(made, capsys):
    folder, _ = made
    found = folder / "found" / "dataset.json"
    run("frame", folder, "--truth", found, code=2)
    assert "compared with itself" in capsys.readouterr().err
    run("frame", folder, "--truth", folder / "true" / "dataset.json", "-sfr", "ignored")
    assert (folder / "true" / "results" / "dataset_ground_truth_frame_results.csv").is_file()


@pytest.mark.parametrize("kind", ["frame", "transform"])
def test_what_atoms_batches_give_every_evaluation_is_answered_with_a_note(
    made, tmp_path, capsys, kind
):
    folder, edge = made
    ends = ["-p", edge.parent, "-c", edge.child] if kind == "transform" else []
    common = ["-uic", "-rpd", "-pn", "pattern_1", "-si"]
    run(kind, folder, *ends, "-sfrn", tmp_path / "with.csv", *common)
    told = capsys.readouterr().err
    assert all(f"{option} has no meaning here" in told for option in common if "-" in option)
    assert told.count("has no meaning here, because") == 4
    run(kind, folder, *ends, "-sfrn", tmp_path / "without.csv")
    assert (tmp_path / "with.csv").read_bytes() == (tmp_path / "without.csv").read_bytes()


@pytest.fixture(scope="module")
def odometry(tmp_path_factory):
    """Return a folder in which the found odometry is off, and the odometry's edge."""
    folder = tmp_path_factory.mktemp("odometry")
    true, edge = planar_motion(1, collections=4).dataset, Edge("world", "robot_base")
    tfs = {"odometry": EdgeConfig(parent_link=edge.parent, child_link=edge.child)}
    true = replace(true, config=replace(true.config, additional_tfs=tfs))
    moves = {key: {edge: c.transforms[edge] @ MOVE} for key, c in true.collections.items()}
    write_dataset_folder(true, folder / "true", name="true")
    write_dataset_folder(true.with_transforms(moves), folder / "found", name="found")
    return folder, edge


def test_odometry_that_is_the_test_sets_own_is_not_called_exact(odometry, tmp_path, capsys):
    folder, edge = odometry
    run("frame", folder, "-sfrn", tmp_path / "frames.csv")
    assert f"note: '{edge}' was estimated for each collection" in capsys.readouterr().out
    _, rows = table(tmp_path / "frames.csv")
    assert rows and not [name for name in rows if edge.child in name]
    run("frame", folder, "-sf", edge.child, code=2)
    run("transform", folder, "-p", edge.parent, "-c", edge.child, code=2)
    assert "is not measured here" in capsys.readouterr().err
