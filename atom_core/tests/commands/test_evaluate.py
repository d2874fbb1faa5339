"""The command ``evaluate``: files, exit codes, refusals."""

import json
import shutil
from dataclasses import replace

import pytest

from atom_core.cli import main
from atom_core.evaluation.same_data import shared_collections
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.truth_json import write_truth
from atom_core.synthetic import PLAIN, degenerate
from atom_core.synthetic.scenes import hand_eye, random_scene


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    synthetic = random_scene(1, rgb=2, depth=1, lidar3d=2, collections=4)
    write_dataset_folder(synthetic.dataset, folder / "test", name="test")
    write_truth(synthetic.truth, folder / "truth.json")
    return folder


@pytest.fixture
def evaluate(scene, tmp_path):
    def run(*options, train=None, output=tmp_path / "out"):
        dataset = str(scene / "test" / "dataset.json")
        arguments = ["evaluate", "--train", str(train or dataset), "--test", dataset]
        return main([*arguments, "--output", str(output), *map(str, options)]), output

    return run


def result(folder):
    return json.loads((folder / "evaluation.json").read_text())


def test_files_and_tables(evaluate, scene, capsys):
    code, output = evaluate("--truth", scene / "truth.json")
    assert code == 0
    names = {p.name for p in output.iterdir()}
    assert {"evaluation.json", "rgb-rgb.csv", "lidar3d-rgb.csv", "depth-rgb.csv"} < names
    document = result(output)
    assert document["ground_truth"]["mean"]["translation_error_m"] == pytest.approx(0, abs=1e-9)
    for pair in document["pairs"]:
        if pair["skipped"] is None:
            assert pair["rms"] == pytest.approx(pair["at_truth"]["rms"], rel=1e-6)
    assert "Averages over the pairs" in capsys.readouterr().out


def test_pairs_and_selections(evaluate):
    _, output = evaluate("--pairs", "rgb_1:rgb_2", "-csf", "000", "001")
    document = result(output)
    assert {p["kind"] for p in document["pairs"]} == {"rgb-rgb"}
    assert set(document["pairs"][0]["per_collection"]) <= {"000", "001"}


def test_a_test_set_that_was_calibrated_with_is_told(evaluate, capsys):
    _, output = evaluate("-csf", "000", "001")
    told = "2 of 2 collections of the test set are those that were calibrated with (000, 001)"
    assert f"warning: {told}" in capsys.readouterr().out
    (warning,) = result(output)["warnings"]  # the report shows it above the figures
    assert warning.startswith(told)
    one, other = (random_scene(seed, collections=3).dataset for seed in (1, 2))
    assert shared_collections(one, other) == []
    assert shared_collections(one, one.selected(collections=["001"])) == ["001"]


def test_what_the_reader_had_to_tolerate_of_the_test_set_is_told(scene, tmp_path, capsys):
    train, test = (scene / "test" / name for name in ("dataset.json", "resized.json"))
    document = json.loads(train.read_text())
    document["calibration_config"]["calibration_patterns"]["pattern_1"]["size"] *= 1.02
    test.write_text(json.dumps(document))
    line = ["evaluate", "--train", train, "--test", test, "--output", tmp_path / "out"]
    assert main(list(map(str, line))) == 0
    told = "differ from what the configuration says; the dataset's own are used"
    shown, warnings = capsys.readouterr().out, result(tmp_path / "out")["warnings"]
    assert told in shown and any(told in warning for warning in warnings)


@pytest.mark.parametrize("option, offset_m", [(["--range_offset", "lidar_1"], 0.03), ([], 0.0)])
def test_an_error_of_ranges_that_was_estimated_is_still_in_the_data_and_told(
    tmp_path, option, offset_m
):
    realism = replace(PLAIN, lidar_offset_m=offset_m)
    synthetic = random_scene(1, rgb=2, depth=0, lidar3d=1, collections=12, realism=realism)
    write_dataset_folder(synthetic.dataset, tmp_path / "d", name="d")
    data = str(tmp_path / "d" / "dataset.json")
    files = ["--output", str(tmp_path / "calibrated"), "--no_report"]
    assert main(["calibrate", "--dataset", data, *files, *option]) == 0
    train = str(tmp_path / "calibrated" / "atom_calibration.json")
    out = ["--output", str(tmp_path / "out"), "--no_report"]
    assert main(["evaluate", "--train", train, "--test", data, *out]) == 0
    told = [w for w in result(tmp_path / "out")["warnings"] if "still have in them" in w]
    assert bool(told) == bool(option)
    assert all("lidar_1 reads" in warning and "mm long" in warning for warning in told)


def test_options_with_dash_and_underscore(evaluate):
    assert evaluate("--sensor-selection-function", "rgb_*")[0] == 0
    assert (
        evaluate("--sensor_selection_function", "lambda n: n in ['rgb_1', 'rgb_2']", "--overwrite")[
            0
        ]
        == 0
    )


def test_another_calibration_beside(evaluate, scene, capsys):
    code, output = evaluate("--compare", scene / "test" / "dataset.json")
    assert code == 0
    document = result(output)
    assert document["compared_with"]["averages"] == document["averages"]
    assert "RMS of the other" in capsys.readouterr().out


def test_results_are_not_overwritten_unasked(evaluate, capsys):
    _, output = evaluate("--pairs", "rgb_1:rgb_2")
    before = (output / "evaluation.json").read_bytes()
    code, _ = evaluate()
    assert code == 2 and "--overwrite" in capsys.readouterr().err
    assert (output / "evaluation.json").read_bytes() == before


def test_tables_of_an_earlier_run_do_not_stay(evaluate):
    _, output = evaluate()
    assert (output / "depth-rgb.csv").is_file()
    evaluate("--pairs", "rgb_1:rgb_2", "--overwrite")
    assert not (output / "depth-rgb.csv").exists() and (output / "rgb-rgb.csv").is_file()


def test_exit_code_1_when_nothing_could_be_measured(scene, tmp_path, capsys):
    shutil.copy(scene / "test" / "dataset.json", tmp_path / "dataset.json")  # without its data
    dataset, output = str(tmp_path / "dataset.json"), tmp_path / "out"
    arguments = ["evaluate", "--train", dataset, "--test", dataset, "--output", str(output)]
    assert main([*arguments, "-ssf", "rgb_1", "lidar*"]) == 1
    captured = capsys.readouterr()
    assert "is absent" in captured.out and "no pair was measured" in captured.err
    assert all(pair["skipped"] for pair in result(output)["pairs"])


def test_exit_code_1_when_there_is_nothing_to_compare(evaluate, capsys):
    assert evaluate("-ssf", "rgb_1")[0] == 1
    assert "no two of these sensors can be compared" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options, words",
    [
        (["--pairs", "rgb_1:nobody"], "rgb_1:nobody"),
        (["-ssf", "nobody"], "nobody"),
        (["--truth", "nowhere.json"], "nowhere.json"),
        (["--compare", "nowhere.json"], "nowhere.json"),
    ],
)
def test_bad_input_is_refused_in_one_line_and_nothing_is_written(evaluate, capsys, options, words):
    code, output = evaluate(*options)
    error = capsys.readouterr().err
    assert code == 2 and words in error and error.count("\n") == 1
    assert not output.exists()


def test_hand_annotations_beside_the_test_set_are_used_and_doubted(scene, evaluate, capsys):
    _, output = evaluate()
    assert result(output)["annotations_in_doubt"] == []
    plain = result(output)["averages"]["lidar3d-rgb"]["rms"]
    for sensor in ("rgb_1", "rgb_2"):
        far = {"top": {"xs": [0.0, 1.0], "ys": [0.0, 0.0]}}
        annotation = {"_metadata": {}, **{f"{i:03d}": far for i in range(4)}}
        (scene / "test" / f"annotation_{sensor}.json").write_text(json.dumps(annotation))
    try:
        evaluate("--overwrite")
        assert result(output)["averages"]["lidar3d-rgb"]["rms"] > plain + 100
        doubts = result(output)["annotations_in_doubt"]
        assert doubts and all(
            f"warning: {doubt}" in capsys.readouterr().out for doubt in doubts[:1]
        )
        assert any("annotation_rgb_1.json: the border drawn in collection 00" in d for d in doubts)
    finally:
        for sensor in ("rgb_1", "rgb_2"):
            (scene / "test" / f"annotation_{sensor}.json").unlink()


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    synthetic = hand_eye(1, collections=8, disturbance=(0.01, 0.01))
    write_dataset_folder(synthetic.dataset, folder / "test", name="test")
    write_truth(synthetic.truth, folder / "truth.json")
    return folder


def test_one_camera_on_an_arm_is_evaluated_beside_the_test_set(arm, capsys):
    dataset, results = arm / "test" / "dataset.json", arm / "test" / "results" / "dataset"
    line = ["evaluate", "--train", str(dataset), "--test", str(dataset)]
    line += ["--truth", str(arm / "truth.json"), "--baseline", "hand_eye"]
    assert main(line) == 0
    shown = capsys.readouterr().out
    assert "Spread of fixed boards" in shown and "OpenCV park" in shown and str(results) in shown
    document = result(results)
    assert document["pairs"] == [] and document["averages"] == {}
    (single,), (spread,) = document["single_cameras"], document["between_collections"]
    assert single["one_pose"] and single["mean"] > 2.0 * single["at_truth"]["mean"]
    assert spread["translation_mm"] > 2.0 * spread["at_truth"]["translation_mm"]
    assert spread["collections"] == 28  # pairs of eight
    assert main(line) == 2 and "--overwrite" in capsys.readouterr().err

    # What a method found is a dataset like any other, wherever it lies.
    again = ["evaluate", "--train", str(results / "hand_eye_park.json"), "--test", str(dataset)]
    assert main([*again, "--output", str(arm / "park")]) == 0
    of_park = document["baselines"]["hand_eye_park"]
    for key in ("single_cameras", "between_collections"):
        for figure in ("rms", "mean", "points"):
            found = result(arm / "park")[key][0][figure]
            assert found == pytest.approx(of_park[key][0][figure], rel=1e-6)
    assert of_park["cameras"]["rgb_1"]["error_m"] < 0.02
    ours = document["baselines"]["hand_eye"]["cameras"]["rgb_1"]
    assert ours["reprojection_px"] == pytest.approx(single["mean"])


def test_a_baseline_that_motion_does_not_allow_is_named_beside_all_else(tmp_path, capsys):
    scene = degenerate.translating_arm(0, collections=4)
    dataset = write_dataset_folder(scene.dataset, tmp_path / "test", name="test")
    line = ["evaluate", "--train", str(dataset), "--test", str(dataset), "--baseline", "hand_eye"]
    assert main(line) == 1
    assert "only translates" in capsys.readouterr().err
    (written,) = tmp_path.glob("test/**/evaluation.json")
    (why,) = json.loads(written.read_text())["baselines_left_out"]
    assert "only translates" in why
