"""ATOM's command lines of `calibrate`: each runs, with ATOM's meaning or with a note."""

import csv
import io
import json
import shlex
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml

from atom_core import cli
from atom_core.commands.atom_options import CALIBRATE, LIVE
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.truth_json import read_truth, write_truth
from atom_core.model.truth import truth_of
from atom_core.synthetic import arm, scenes

# What ATOM's pages for users tell them to type, behind `calibrate -json dataset.json`.
RECIPES = (
    "-v -rv -nig 0.1 0.1",
    "-v -rv -nig 0.1 0.1 -ss 3 -csf 'lambda x: int(x) < 6'",
    "-v -rv -si -ipg -ctgt -nig 0.03 0.03",
    "-v -rv -si -vo -uic -oi -ftol 1e-4 -xtol 1e-4 -gtol 1e-4",
    "--verbose --phased -dpcc -da 0.2 -ajf -rv",
    "-sce -snv -rnm 0.5 -sr 0.4 -slr 0.2 -max_nfev 30 -diff_step 1e-6 -ias",
    "-ssf 'lambda s: s in [\"rgb_1\", \"rgb_2\"]' -psf 'lambda p: True' -rpd -as rgb_1",
    "-nig 0.05 0.02 -ctgt -sfr -sfrn {folder}/short.csv",
)
JOINTS = (
    "-v -nig 0 0 -ctgt -jbn shoulder_pan elbow -jbp origin_x position_bias -jbv 0.003 -0.02",
    "-ajf -jsf 'lambda j: j in [\"elbow\"]' -jpsf 'lambda p: p == \"position_bias\"'",
)
OURS = {option.short: option for option in CALIBRATE if option.ours is not None}


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Return the folder of a tiny dataset, never written to again."""
    folder = tmp_path_factory.mktemp("cell")
    scene = scenes.random_scene(2, depth=0, lidar3d=1, collections=6)
    write_dataset_folder(scene.dataset, folder / "data", name="train")
    write_truth(scene.truth, folder / "truth.json")
    return folder


@pytest.fixture
def copy(cell, tmp_path):
    """Return the path of the dataset in a folder of its own."""
    shutil.copytree(cell / "data", tmp_path / "data")
    return tmp_path / "data" / "dataset.json"


def calibrate(dataset, line, code=0):
    words = ["calibrate", "-json", str(dataset), *shlex.split(line)]
    assert cli.main(words) == code
    return json.loads((dataset.parent / "calibration.json").read_text())


@pytest.mark.parametrize("option", CALIBRATE, ids=lambda option: option.short)
def test_every_option_of_atom_is_known_by_both_names(option, capsys):
    others = [] if option.short == "json" else ["-json", "dataset.json"]
    values = []
    for name in option.names:
        words = ["calibrate", *others, name, *option.example.split("  ")[: bool(option.example)]]
        words = words[:-1] + words[-1].split(" ") if option.short == "nig" else words
        args = cli.build_parser().parse_args(words)
        note = capsys.readouterr().err
        if option.ours is None or option.ours in LIVE:
            assert note.count("\n") == 1 and "has no meaning here, because" in note
            assert f"-{option.short} " in note
        else:
            assert not note
            values.append(getattr(args, option.ours))
    assert not values or (values[0] == values[1] and values[0] not in (None, False))


def test_an_option_that_nobody_knows_is_refused_with_its_neighbours(capsys):
    with pytest.raises(SystemExit) as refused:
        cli.main(["calibrate", "-json", "dataset.json", "-sfrm"])
    assert refused.value.code == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "-sfr" in line.partition("nearest")[2]


@pytest.mark.parametrize("line", RECIPES)
def test_what_atoms_users_type_runs(copy, line, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("c\nc\n"))  # of -phased
    document = calibrate(copy, line.format(folder=copy.parent))
    assert document["status"] == "converged"
    assert "results: " in capsys.readouterr().out


def test_the_multiplier_of_corners_is_of_atoms_weights(copy, capsys):
    """Corners that weigh more fit better, points worse; with sigmas nothing changes: said so."""

    def residuals(line):
        document = calibrate(copy, f"-ow --loss none {line}")
        means = {}
        for sensor in document["sensors"].values():
            for kind, statistics in sensor["residuals"].items():
                means.setdefault(kind, []).append(statistics["mean"])
        return {kind: np.mean(values) for kind, values in means.items()}, document["warnings"]

    (more, _), (less, _) = (residuals(f"--weights atom -rnm {x}") for x in (0.5, 2.0))
    assert more["reprojection"] < less["reprojection"]
    assert more["orthogonal"] > less["orthogonal"]
    _, said = residuals("--weights atom --intrinsics_sigma 0.1")
    assert any("--intrinsics_sigma has no effect" in warning for warning in said)
    (usual, _), (same, said) = residuals(""), residuals("-rnm 0.1")
    assert usual == same and any("-rnm has no effect" in warning for warning in said)
    capsys.readouterr()
    assert cli.main(["calibrate", "-json", str(copy), "-ow", "-rnm", "0"]) == 2
    assert "a multiplier is a number above 0" in capsys.readouterr().err


def test_results_lie_beside_the_dataset_under_atoms_names(copy, capsys):
    before = {path.name: path.read_bytes() for path in copy.parent.iterdir()}
    calibrate(copy, "-nig 0.01 0.01 -sce -ctgt -sfr -sfrn " + str(copy.parent / "s.csv"))
    made = {path.name for path in copy.parent.iterdir()} - set(before)
    assert made >= {
        "atom_calibration.json",
        "atom_calibration_params.yml",
        "original_calibration_params.yml",
        "command_line_args.yml",
        "calibration_errors.csv",
        "comparison_to_ground_truth_transforms.csv",
        "s.csv",
    }
    for name, content in before.items():
        assert (copy.parent / name).read_bytes() == content
    typed = yaml.safe_load((copy.parent / "command_line_args.yml").read_text())
    assert typed["noisy_initial_guess"] == [0.01, 0.01]
    original = yaml.safe_load((copy.parent / "original_calibration_params.yml").read_text())
    rgb_2 = read_dataset(copy).sensors["rgb_2"].edge
    first = read_dataset(copy).first_value(rgb_2)
    assert original["sensors"]["rgb_2"]["x"] == pytest.approx(first[0, 3], abs=1e-12)
    capsys.readouterr()
    assert cli.main(["calibrate", "-json", str(copy)]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "--overwrite" in line and "atom_calibration.json" in line
    assert cli.main(["calibrate", "-json", str(copy), "-ow"]) == 0
    result = copy.with_name("atom_calibration.json")
    assert cli.main(["calibrate", "-json", str(result), "--overwrite"]) == 2  # its own input
    assert "--output" in capsys.readouterr().err


def test_errors_against_the_truth_before_and_after(copy, cell, tmp_path):
    """-ctgt takes the input as the truth; -nig is then the error before, found back after."""
    scene_truth = read_truth(cell / "truth.json")
    dataset = read_dataset(copy)
    document = calibrate(copy, "-nig 0.1 0.05 -ctgt -sfr -sfrn " + str(tmp_path / "short.csv"))
    by_name = {error["name"]: error for error in document["truth_comparison"]["edges"]}
    anchored = dataset.config.anchored_sensor
    assert by_name[anchored]["before"]["translation_error_m"] == 0.0
    others = [error for name, error in by_name.items() if name != anchored]
    assert len(others) == 2
    for error in others:
        assert error["before"]["translation_error_m"] == pytest.approx(0.1, abs=1e-9)
        assert error["before"]["rotation_error_rad"] == pytest.approx(0.05, abs=1e-9)
        assert error["after"]["translation_error_m"] < 0.005
    path = copy.with_name("comparison_to_ground_truth_transforms.csv")
    assert path.read_bytes().count(b"\r\n") == 5
    header, *rows = csv.reader(path.read_text().splitlines())
    assert header == ["Transform", "Description", "Et0 [m]", "Et [m]", "Rrot0 [rad]", "Erot [rad]"]
    assert rows[-1][0] == "Averages" and float(rows[-1][2]) == pytest.approx(0.2 / 3, abs=1e-5)
    short = list(csv.reader((tmp_path / "short.csv").read_text().splitlines()))
    assert short[0] == ["Transform", "Et [m]", "Erot [rad]"] and len(short) == 4
    assert set(scene_truth.edges) == {dataset.sensors[name].edge for name in by_name}


def test_partial_labels_are_not_used_but_kept(copy):
    counts = [(key, label.size) for key, label in read_dataset(copy).detections()]
    partial = [key for key, size in counts if key.sensor.startswith("rgb") and size < 88]
    if not partial:
        pytest.fail("the scene has no partial label")
    whole = calibrate(copy, "")
    assert cli.main(["calibrate", "-json", str(copy), "-rpd", "-ow"]) == 0
    document = json.loads((copy.parent / "calibration.json").read_text())
    used = [sum(s["detections"] for s in d["sensors"].values()) for d in (whole, document)]
    assert used[1] <= used[0] - len(partial)
    again = read_dataset(copy.with_name("atom_calibration.json"))
    assert {key for key, _ in again.detections()} == {key for key, _ in counts}


def test_a_camera_with_nothing_but_partial_labels_is_named(real_data, tmp_path, capsys):
    path = real_data("atom_softbot") / "nig_0.1_run001" / "atom_calibration.json"
    line = ["calibrate", "-json", str(path), "-rpd", "-ssf", "*camera", "-o", str(tmp_path / "out")]
    assert cli.main(line) == 2
    assert "all labels of sensor 'front_left_camera' lack corners" in capsys.readouterr().err


def test_only_the_anchored_sensor_is_held_and_boards_are_placed(copy):
    document = calibrate(copy, "-oas")
    assert list(document["sensors"]) == ["rgb_1"]
    assert any(warning.startswith("-oas: ") for warning in document["warnings"])
    assert [edge["anchored"] for edge in document["edges"].values()] == [True]
    before, after = read_dataset(copy), read_dataset(copy.with_name("atom_calibration.json"))
    edge = before.sensors["rgb_1"].edge
    np.testing.assert_array_equal(before.first_value(edge), after.first_value(edge))


def test_residuals_by_collection_and_their_multiples(copy, capsys):
    document = calibrate(copy, "-snv -sce")
    out = capsys.readouterr().out
    header, *rows = csv.reader((copy.with_name("calibration_errors.csv")).read_text().splitlines())
    units = {"rgb_1": "px", "rgb_2": "px", "lidar_1": "m"}
    assert header[1:] == [f"{name} [{units[name]}]" for name in document["sensors"]]
    assert [row[0] for row in rows] == [*sorted(document["collections"], key=int), "Averages"]
    residual = document["collections"]["000"]["residuals"]["rgb_1"]["reprojection"]["mean"]
    assert rows[0][header.index("rgb_1 [px]")] == f"{residual:.4f}"
    sigma = document["sensors"]["rgb_1"]["sigma"]["reprojection_px"]
    assert f"{residual:.4f} ({residual / sigma:.2f})" in out


def test_boards_are_held_where_a_sensor_saw_them_first(copy):
    """A raw dataset carries its boards' first poses in `patterns.*.transforms_initial` alone."""
    document = json.loads(copy.read_text())
    solved = calibrate(copy, "")
    assert solved["status"] == "converged"
    result = json.loads(copy.with_name("atom_calibration.json").read_text())
    name, pattern = next(iter(document["patterns"].items()))
    entry = document["calibration_config"]["calibration_patterns"][name]
    edge = f"{entry['parent_link']}-{entry['link']}"
    for key, collection in result["collections"].items():
        assert edge not in document["collections"][key]["transforms"]
        pose = collection["transforms"][edge]
        pattern["transforms_initial"][key] = {"detected": True, "sensor": "rgb_1", **pose}
    raw = copy.with_name("raw.json")
    raw.write_text(json.dumps(document))
    assert cli.main(["calibrate", "-json", str(raw), "-ap", "-ow"]) == 0
    held = json.loads((copy.parent / "calibration.json").read_text())
    assert any("transforms_initial" in warning for warning in held["warnings"])
    for name, edge in held["edges"].items():
        moved = np.subtract(edge["translation_m"], solved["edges"][name]["translation_m"])
        assert np.linalg.norm(moved) < 1e-3
    assert cli.main(["calibrate", "-json", str(raw), "-gtpp", "-ow"]) == 2  # nobody knows them


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """Return the folder of a dataset of a camera on an arm, whose elbow is to be calibrated."""
    folder = tmp_path_factory.mktemp("arm") / "data"
    scene = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.0}}, collections=6)
    write_dataset_folder(scene.dataset, folder, name="arm")
    return folder


@pytest.mark.parametrize("line", JOINTS)
def test_joints_are_disturbed_and_found(robot, tmp_path, line):
    shutil.copytree(robot, tmp_path / "data")
    document = calibrate(tmp_path / "data" / "dataset.json", line)
    if "-jbv" in line:
        joints = {(e["joint"], e["parameter"]): e for e in document["truth_comparison"]["joints"]}
        elbow = joints[("elbow", "position_bias")]
        assert elbow["before"] == pytest.approx(-0.02)
        assert abs(elbow["after"]) < 0.002
        assert joints[("shoulder_pan", "origin_x")]["after"] == pytest.approx(0.003)  # not selected


def test_a_truth_that_does_not_tell_an_estimated_joint_is_named(robot, tmp_path, capsys):
    shutil.copytree(robot, tmp_path / "data")
    dataset = tmp_path / "data" / "dataset.json"
    truth = truth_of(read_dataset(dataset))
    line = ["calibrate", "-json", str(dataset), "-ow", "--truth"]
    silent, telling = tmp_path / "silent.json", tmp_path / "telling.json"
    write_truth(replace(truth, joints={}), silent)
    write_truth(truth, telling)
    assert cli.main([*line, str(silent)]) == 0
    assert "truth does not tell elbow" in " ".join(capsys.readouterr().out.split())
    assert cli.main([*line, str(telling)]) == 0
    assert "truth does not tell" not in " ".join(capsys.readouterr().out.split())


def test_whoever_ends_a_phased_run_before_the_solver_gets_no_results(copy, monkeypatch, capsys):
    before = sorted(copy.parent.iterdir())
    monkeypatch.setattr("sys.stdin", io.StringIO("x\nq\n"))
    assert cli.main(["calibrate", "-json", str(copy), "-phased"]) == 2
    assert sorted(copy.parent.iterdir()) == before
    assert "nothing is written" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("-jbn elbow -jbv 0.1", "1, 0 and 1"),
        ("-jbn knee -jbp origin_x -jbv 0.1", "no such joint"),
        ("-oas -ias", "leave one out"),
        ("-ctgt --truth x.json", "two truths"),
        ("--truth x.json", "x.json: no such truth file"),
        ("-uic --complete_only", "leave one of the two out"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(copy, line, words, capsys):
    assert cli.main(["calibrate", "-json", str(copy), *line.split()]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and words in error
    assert not copy.with_name("calibration.json").exists()
