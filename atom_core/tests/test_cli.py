"""The commands as users meet them: results, exit codes, and one clear line for every refusal."""

import json
import shutil
from copy import deepcopy

import pytest

from atom_core import native
from atom_core.cli import main
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.truth_json import write_truth
from atom_core.synthetic import Noise, paper_cell, scenes

CALIBRATION_KEYS = {
    "version",
    "dataset",
    "seed",
    "options",
    "status",
    "message",
    "contradictions",
    "verdict",
    "solver",
    "edges",
    "degrees_of_freedom",
    "joints",
    "sensors",
    "collections",
    "propagation",
    "outliers",
    "outlier_count",
    "outlier_limit_sigmas",
    "rejected_detections",
    "weak_directions",
    "priors",
    "held_by_prior",
    "model_errors",
    "moving_parts",
    "moving_edges",
    "misfits",
    "exclusions",
    "warnings",
    "inputs",
    "versions",
    "trust_checks",
}


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Return the folder of a small dataset on disk with its truth."""
    folder = tmp_path_factory.mktemp("cell")
    scene = scenes.random_scene(0, collections=8, disturbance=(0.05, 0.05))
    write_dataset_folder(scene.dataset, folder / "data", name="train")
    write_truth(scene.truth, folder / "truth.json")
    return folder


def edited(cell, tmp_path, change):
    """Return the path of a copy of the dataset's JSON, beside its data, after a change."""
    document = json.loads((cell / "data" / "dataset.json").read_text())
    change(document)
    path = cell / "data" / f"{tmp_path.name}.json"
    path.write_text(json.dumps(document))
    return path


def refusal(capsys, *arguments):
    """Run a command that must refuse; return its one line."""
    assert main([str(a) for a in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1, captured.err
    assert captured.out == ""
    return captured.err


def calibrate(capsys, path, output, *more):
    line = refusal(capsys, "calibrate", "--dataset", path, "--output", output, *more)
    assert not output.exists(), "a refusal writes nothing"
    return line


def test_calibrate_writes_what_the_interface_names(cell, tmp_path, capsys):
    output = tmp_path / "out"
    truth = ["--truth", str(cell / "truth.json")]
    dataset = str(cell / "data" / "dataset.json")
    assert main(["calibrate", "-json", dataset, "--output", str(output), *truth]) == 0
    document = json.loads((output / "calibration.json").read_text())
    assert set(document) == CALIBRATION_KEYS | {"ground_truth", "truth_comparison"}
    assert document["status"] == "converged"
    assert document["ground_truth"]["mean"]["translation_error_m"] < 0.005
    assert (output / "atom_calibration_params.yml").is_file()
    calibrated = read_dataset(output / "atom_calibration.json")
    edge = calibrated.sensors["lidar_1"].edge
    written = next(iter(calibrated.collections.values())).transforms[edge][:3, 3]
    assert list(written) == document["edges"][str(edge)]["translation_m"]
    assert "converged" in capsys.readouterr().out


def test_dashes_and_underscores_and_atoms_short_options_are_one(cell, tmp_path):
    dataset = str(cell / "data" / "dataset.json")
    for i, spelling in enumerate(("-nig", "--noisy-initial-guess", "--noisy_initial_guess")):
        arguments = ["calibrate", "--dataset", dataset, "--output", str(tmp_path / str(i))]
        assert main([*arguments, spelling, "0.02", "0.02", "-ss", "7"]) == 0
    costs = {
        json.loads((tmp_path / str(i) / "calibration.json").read_text())["solver"]["cost_final"]
        for i in range(3)
    }
    assert len(costs) == 1


def test_not_converged_is_exit_1_and_written(cell, tmp_path):
    output = tmp_path / "out"
    dataset = str(cell / "data" / "dataset.json")
    words = ["--dataset", dataset, "--output", str(output), "--max_iterations", "1"]
    assert main(["calibrate", *words]) == 1
    assert json.loads((output / "calibration.json").read_text())["status"] == "not_converged"


def test_the_calibrated_dataset_is_a_start_that_does_not_move(cell, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    dataset = str(cell / "data" / "dataset.json")
    main(["calibrate", "--dataset", dataset, "--output", str(first)])
    assert (
        main(["calibrate", "-json", str(first / "atom_calibration.json"), "--output", str(second)])
        == 0
    )
    before, after = (json.loads((d / "calibration.json").read_text()) for d in (first, second))
    for name, edge in before["edges"].items():
        assert after["edges"][name]["translation_m"] == pytest.approx(
            edge["translation_m"], abs=2e-5
        )


def test_a_result_is_the_next_input_wherever_it_lies(cell, tmp_path, capsys):
    """In a folder of its own, moved with the data, beside them, and without them."""
    whole = tmp_path / "whole"
    shutil.copytree(cell / "data", whole / "data")
    run = ["calibrate", "--dataset", str(whole / "data" / "dataset.json")]
    assert main([*run, "--output", str(whole / "results" / "1")]) == 0
    moved = tmp_path / "moved"
    whole.rename(moved)
    result = moved / "results" / "1" / "atom_calibration.json"
    assert main(["check", "--dataset", str(result)]) == 0
    beside = moved / "data" / "again.json"
    shutil.copy(result, beside)
    assert main(["check", "--dataset", str(beside)]) == 0
    alone = tmp_path / "alone" / "atom_calibration.json"
    alone.parent.mkdir()
    shutil.copy(result, alone)
    capsys.readouterr()
    line = calibrate(capsys, alone, tmp_path / "out")
    assert "are absent" in line and "move both together" in line and str(alone) in line


def test_check_is_0_when_ready_and_1_when_not(cell, tmp_path, capsys):
    assert main(["check", "--dataset", str(cell / "data" / "dataset.json")]) == 0
    assert "verdict: GOOD. Ready to calibrate" in capsys.readouterr().out

    def blind(document):
        for collection in document["collections"].values():
            label = collection["labels"]["pattern_1"]["lidar_1"]
            label.update(detected=False, idxs=[], idxs_limit_points=[])

    assert main(["check", "--dataset", str(edited(cell, tmp_path, blind))]) == 1
    told = capsys.readouterr().out
    assert "'lidar_1' has no detection" in told and "ready to calibrate" not in told.lower()


def test_check_gives_atoms_mean_errors(real_data, capsys):
    path = real_data("atom_softbot") / "nig_0.1_run001" / "atom_calibration.json"
    assert main(["check", "--dataset", str(path)]) == 1  # the LiDAR's clouds are absent
    averages = next(s for s in capsys.readouterr().out.splitlines() if s.startswith("Averages"))
    assert averages.split()[1:] == ["43.2989", "32.4126"]


def test_rank_deficient_is_exit_1_and_written(real_data, tmp_path):
    path = real_data("atom_softbot") / "nig_0.1_run001" / "atom_calibration.json"
    output = tmp_path / "out"
    assert (
        main(
            [
                "calibrate",
                "--dataset",
                str(path),
                "-ssf",
                "front_*",
                "-nig",
                "0.1",
                "0.1",
                "--output",
                str(output),
            ]
        )
        == 1
    )
    document = json.loads((output / "calibration.json").read_text())
    assert document["status"] == "rank_deficient"
    for sensor in document["sensors"].values():
        assert sensor["residuals"]["reprojection"]["mean"] <= 0.12
    assert "front_left_camera z" in document["weak_directions"][0]["parameters"]


def test_a_result_can_be_an_input_again_from_where_it_is(cell, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    dataset = str(cell / "data" / "dataset.json")
    main(["calibrate", "--dataset", dataset, "--output", str(first)])
    result = str(first / "atom_calibration.json")
    assert main(["calibrate", "--dataset", result, "--output", str(second), "-ap"]) == 0


def test_collections_left_out_are_not_in_the_result(cell, tmp_path):
    dataset, output = str(cell / "data" / "dataset.json"), tmp_path / "out"
    assert main(["calibrate", "--dataset", dataset, "--output", str(output), "-csf", "!000"]) == 0
    document = json.loads((output / "atom_calibration.json").read_text())
    assert "000" not in document["collections"] and "001" in document["collections"]


def test_a_damaged_label_can_be_left_out(cell, tmp_path):
    def spoil(document):
        document["collections"]["000"]["labels"]["pattern_1"]["rgb_1"]["idxs"][0]["x"] = None

    path = edited(cell, tmp_path, spoil)
    arguments = ["--dataset", str(path), "--output", str(tmp_path / "out"), "-csf", "!000"]
    assert main(["calibrate", *arguments]) == 0


def test_a_sensor_that_shares_no_board_is_told_so(cell, tmp_path, capsys):
    path = cell / "data" / "dataset.json"
    line = calibrate(capsys, path, tmp_path / "out", "-ssf", "rgb_1")
    assert "'rgb_1' sees no board together with another" in line and "a second sensor" in line


# ---------------------------------------------------------------------------- refusals


def test_a_missing_file(tmp_path, capsys):
    line = calibrate(capsys, tmp_path / "none.json", tmp_path / "out")
    assert "no such file" in line and "--dataset" not in line  # `evaluate` has no such option


def test_truncated_json(cell, tmp_path, capsys):
    text = (cell / "data" / "dataset.json").read_text()
    (tmp_path / "cut.json").write_text(text[: len(text) // 2])
    line = calibrate(capsys, tmp_path / "cut.json", tmp_path / "out")
    assert "cut.json:" in line and "truncated" in line


def test_an_old_version_says_how_to_migrate_and_the_migration_works(cell, tmp_path, capsys):
    def make_old(document):
        document["_metadata"]["version"] = "2.0"
        config = document["calibration_config"]
        config["calibration_pattern"] = config.pop("calibration_patterns")["pattern_1"]
        document["patterns"] = document["patterns"]["pattern_1"]
        for collection in document["collections"].values():
            collection["labels"] = collection["labels"]["pattern_1"]

    path = edited(cell, tmp_path, make_old)
    line = calibrate(capsys, path, tmp_path / "out")
    assert "convert --from atom_v2 --to atom_v3" in line
    new = tmp_path / "new"
    assert (
        main(
            [
                "convert",
                "--from",
                "atom_v2",
                "--to",
                "atom_v3",
                "--dataset",
                str(path),
                "--output",
                str(new),
            ]
        )
        == 0
    )
    assert (
        main(
            ["calibrate", "--dataset", str(new / "dataset.json"), "--output", str(tmp_path / "out")]
        )
        == 0
    )


def set_sensor(key, value):
    def change(document):
        document["sensors"]["rgb_1"][key] = value

    return change


def test_an_unknown_modality(cell, tmp_path, capsys):
    path = edited(cell, tmp_path, set_sensor("modality", "radar"))
    assert "'rgb_1': modality 'radar' is unknown" in calibrate(capsys, path, tmp_path / "out")


@pytest.mark.parametrize("key, count", [("K", 8), ("D", 3)])
def test_a_wrong_number_of_intrinsics(cell, tmp_path, capsys, key, count):
    def shorten(document):
        document["sensors"]["rgb_1"]["camera_info"][key] = [1.0] * count

    line = calibrate(capsys, edited(cell, tmp_path, shorten), tmp_path / "out")
    assert f"'rgb_1': {key} has {count} numbers" in line


def test_an_absent_data_file_names_the_sensor_and_the_way_out(cell, tmp_path, capsys):
    def lose(document):
        document["collections"]["000"]["data"]["lidar_1"]["data_file"] = "gone.pcd"

    line = calibrate(capsys, edited(cell, tmp_path, lose), tmp_path / "out")
    assert "'lidar_1'" in line and "-ssf '!lidar_1'" in line


def test_a_dataset_without_its_clouds_can_do_without_the_sensor(cell, tmp_path):
    def lose(document):
        for collection in document["collections"].values():
            collection["data"]["lidar_1"]["data_file"] = "gone.pcd"

    path = edited(cell, tmp_path, lose)
    assert (
        main(
            [
                "calibrate",
                "--dataset",
                str(path),
                "--output",
                str(tmp_path / "out"),
                "-ssf",
                "!lidar_1",
            ]
        )
        == 0
    )


def test_an_edge_off_the_chain(cell, tmp_path, capsys):
    def move(document):
        other = document["sensors"]["lidar_1"]
        document["sensors"]["rgb_2"]["calibration_parent"] = other["calibration_parent"]
        document["sensors"]["rgb_2"]["calibration_child"] = other["calibration_child"]

    line = calibrate(capsys, edited(cell, tmp_path, move), tmp_path / "out")
    assert "'rgb_2': edge" in line and "not on its chain" in line


def test_a_sensor_without_a_detection(cell, tmp_path, capsys):
    def blind(document):
        for collection in document["collections"].values():
            collection["labels"]["pattern_1"]["depth_1"]["detected"] = False

    line = calibrate(capsys, edited(cell, tmp_path, blind), tmp_path / "out")
    assert "'depth_1' has no detection" in line


def test_components_that_share_no_board(tmp_path, capsys):
    write_dataset_folder(scenes.disconnected(0).dataset, tmp_path / "data", name="two")
    line = calibrate(capsys, tmp_path / "data" / "dataset.json", tmp_path / "out")
    assert "{rgb_1, rgb_2}" in line and "{lidar_1, rgb_3}" in line


def test_nan_in_a_label(cell, tmp_path, capsys):
    def spoil(document):
        label = document["collections"]["000"]["labels"]["pattern_1"]["rgb_1"]
        assert label["detected"]
        label["idxs"][0]["x"] = float("nan")

    line = calibrate(capsys, edited(cell, tmp_path, spoil), tmp_path / "out")
    assert "collection 000, sensor 'rgb_1'" in line and "not a number" in line


def test_an_anchored_sensor_that_does_not_exist(cell, tmp_path, capsys):
    path = cell / "data" / "dataset.json"
    line = calibrate(capsys, path, tmp_path / "out", "-as", "camera_9")
    assert "'camera_9'" in line and "rgb_1" in line


def test_an_unknown_modality_is_refused_by_name(cell, tmp_path, capsys):
    path = edited(cell, tmp_path, lambda d: d["sensors"]["lidar_1"].update(modality="radar"))
    line = calibrate(capsys, path, tmp_path / "out")
    assert "sensor 'lidar_1': modality 'radar' is unknown; use rgb, depth" in line


def test_an_output_folder_that_is_not_empty_is_left_alone(cell, tmp_path, capsys):
    output = tmp_path / "out"
    output.mkdir()
    (output / "calibration.json").write_text("precious")
    path = cell / "data" / "dataset.json"
    line = refusal(capsys, "calibrate", "--dataset", path, "--output", output)
    assert "--overwrite" in line
    assert (output / "calibration.json").read_text() == "precious"
    assert main(["calibrate", "--dataset", str(path), "--output", str(output), "-ow"]) == 0


def test_without_the_native_module_scipy_does_it_and_says_how_to_build(
    cell, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(native, "_MODULE", "atom_core._not_built")
    path, output = cell / "data" / "dataset.json", tmp_path / "out"
    assert main(["calibrate", "--dataset", str(path), "--output", str(output)]) == 0
    document = json.loads((output / "calibration.json").read_text())
    assert document["solver"]["name"] == "scipy"
    assert any("make build" in warning for warning in document["warnings"])
    capsys.readouterr()
    line = calibrate(capsys, path, tmp_path / "other", "--solver", "ceres")
    assert "make build" in line and "--solver ceres" in line


@pytest.mark.long
def test_paper_cell_from_disk_equals_paper_cell_from_memory(tmp_path):
    from atom_core.calibration.calibrate import calibrate as solve

    scene = paper_cell(0, "train", Noise(), (0.1, 0.1))
    path = write_dataset_folder(scene.dataset, tmp_path / "data", name="train")
    memory, disk = solve(scene.dataset), solve(read_dataset(path))
    for name, sensor in scene.dataset.sensors.items():
        a, b = (
            next(iter(r.dataset.collections.values())).transforms[sensor.edge]
            for r in (memory, disk)
        )
        assert abs(a[:3, 3] - b[:3, 3]).max() < 2e-4, name


def test_documents_are_not_shared_between_runs(cell):
    dataset = read_dataset(cell / "data" / "dataset.json")
    before = deepcopy(dict(dataset.document))
    from atom_core.calibration.calibrate import calibrate as solve

    solve(dataset)
    assert before == dataset.document
