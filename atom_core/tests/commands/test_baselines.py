"""``evaluate --baseline``: files, tables, what cannot be had, and Kalibr's camchain."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.io.truth_json import write_truth  # noqa: E402
from atom_core.model.dataset import pose  # noqa: E402
from atom_core.model.truth import with_truth  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with a dataset that is off, its truth, and a true camchain."""
    folder = tmp_path_factory.mktemp("made")
    scene = scenes.random_scene(
        6, rgb=2, depth=1, lidar3d=1, collections=5, disturbance=(0.02, 0.02)
    )
    write_dataset_folder(scene.dataset, folder / "test", name="test")
    write_truth(scene.truth, folder / "truth.json")
    true = with_truth(scene.dataset, scene.truth)
    first, chain, before = next(iter(true.collections.values())), {}, None
    for i, name in enumerate(("rgb_2", "rgb_1")):
        sensor = true.sensors[name]
        camera = sensor.camera
        entry = {"camera_model": "pinhole", "distortion_model": "radtan"}
        entry.update(intrinsics=[*camera.focal_px, *camera.centre_px], rostopic=sensor.topic)
        entry.update(distortion_coeffs=[*camera.D[:4]], resolution=[camera.width, camera.height])
        if before:
            entry["T_cn_cnm1"] = pose(first, true.graph, sensor.frame, before).tolist()
        chain[f"cam{i}"], before = entry, sensor.frame
    (folder / "chain.yaml").write_text(json.dumps(chain))
    return folder


def line(made, output, *more):
    dataset = made / "test" / "dataset.json"
    words = ["evaluate", "--train", dataset, "--test", dataset, "--truth", made / "truth.json"]
    return [*words, "--output", output, *more]


def test_a_camchain_of_the_truth_scores_as_the_truth(made, tmp_path):
    more = ["--baseline", "kalibr", "--camchain", made / "chain.yaml"]
    run(*line(made, tmp_path / "out", *more))
    kalibr = json.loads((tmp_path / "out" / "evaluation.json").read_text())["baselines"]["kalibr"]
    (pair,) = (p for p in kalibr["pairs"] if p["kind"] == "rgb-rgb" and not p["reverse"])
    assert pair["rms"] == pytest.approx(pair["at_truth"]["rms"], rel=1e-3)
    (link,) = kalibr["links"]
    assert link["translation_error_m"] < 1e-6 < 0.01 < link["calibration_translation_error_m"]
    (of_link,) = link["pairs"]
    assert of_link["rms"] == pytest.approx(of_link["at_truth_rms"], rel=1e-3)
    assert of_link["calibration_rms"] > 5.0 * of_link["rms"]
    # It is a dataset like any other.
    again = ["evaluate", "--test", made / "test" / "dataset.json", "-ssf", "rgb_*"]
    run(*again, "--train", tmp_path / "out" / "kalibr.json", "--output", tmp_path / "again")


def test_all_that_can_be_had(made, tmp_path, capsys):
    output = tmp_path / "out"
    run(*line(made, output, "--baseline", "all", "--initial", made / "test" / "dataset.json"))
    document = json.loads((output / "evaluation.json").read_text())
    methods = {"opencv", "pairwise", "icp_initial_average", "icp_initial_best"}
    methods |= {"icp_aligned_average", "icp_aligned_best", "icp_aligned_all"}
    assert set(document["baselines"]) == methods
    written = {p.name for p in output.glob("*.json")} - {"evaluation.json"}
    solved = {m for m in methods if document["baselines"][m]["links"]}
    assert written == {f"{m}.json" for m in solved} and {"opencv", "pairwise"} <= solved
    left_out = " ".join(document["baselines_left_out"])
    assert "--baseline hand_eye" in left_out and "--camchain" in left_out
    pairwise = document["baselines"]["pairwise"]
    assert len(pairwise["links"]) == 6 and pairwise["skipped"] is None
    assert pairwise["sensors"]["lidar_1"]["translation_error_m"] > 0.0
    shown = capsys.readouterr().out
    assert "Baselines, two sensors at a time" in shown and "errors against the truth" in shown
    run(*line(made, output, "--overwrite"))
    assert not (output / "opencv.json").exists()  # of an earlier run


@pytest.mark.parametrize("named", [("hand_eye", "opencv"), ("opencv", "hand_eye", "all")])
def test_one_method_without_an_answer_costs_the_others_nothing(named, made, tmp_path, capsys):
    output = tmp_path / "out"
    run(*line(made, output, "--baseline", *named, "-ssf", "rgb_*"), code=1)
    said = capsys.readouterr()
    assert "opencv" in said.out and (output / "opencv.json").is_file()
    assert said.err.startswith("evaluate: --baseline hand_eye: ") and said.err.count("\n") == 1
    document = json.loads((output / "evaluation.json").read_text())
    assert document["baselines"]["opencv"]["links"] and document["pairs"]
    assert any("--baseline hand_eye" in why for why in document["baselines_left_out"])


def test_the_evaluation_stands_where_no_method_has_an_answer(made, tmp_path, capsys):
    more = ["--baseline", "opencv", "-ssf", "rgb_1", "lidar_*"]
    run(*line(made, tmp_path / "out", *more), code=1)
    assert "there are no two sensors" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "evaluation.json").read_text())["pairs"]


def test_a_file_that_was_named_and_cannot_be_used_is_refused(made, tmp_path, capsys):
    out = tmp_path / "out"
    assert "give the camchain" in refused(capsys, *line(made, out, "--baseline", "kalibr"))
    for named in ("kalibr", "all"):
        more = ["--baseline", named, "--camchain", made / "nowhere.yaml"]
        assert "cannot be read" in refused(capsys, *line(made, out, *more))
    for named in ("icp", "all"):
        more = ["--baseline", named, "--initial", made / "nowhere.json"]
        assert "nowhere.json" in refused(capsys, *line(made, out, *more))
    assert not out.exists()
