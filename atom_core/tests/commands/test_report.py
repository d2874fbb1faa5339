"""Reports beside results: when they are written, replaced, left out, refused."""

import json
import os
import shutil
import signal
import sys
from pathlib import Path

import pytest

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share
from command_line import refused, run  # noqa: E402

REPORTS = {"report.html", "report.pdf"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with a dataset, and results without a report."""
    folder = tmp_path_factory.mktemp("rig")
    scene = scenes.random_scene(0, collections=5, disturbance=(0.03, 0.03))
    write_dataset_folder(scene.dataset, folder / "data", name="train")
    words = ["calibrate", "--dataset", folder / "data" / "dataset.json", "--no_report"]
    run(*words, "--output", folder / "results")
    run(
        *("evaluate", "--train", folder / "results" / "atom_calibration.json", "--no_report"),
        *("--test", folder / "data" / "dataset.json", "--output", folder / "evaluation"),
    )
    return folder


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_results_without_a_report_have_what_one_is_made_from(made):
    assert not names(made / "results") & REPORTS and not names(made / "evaluation") & REPORTS
    assert "residuals.npz" in names(made / "results")
    document = json.loads((made / "results" / "calibration.json").read_text())
    assert [entry["what"] for entry in document["inputs"]] == ["dataset"]
    assert len(document["inputs"][0]["sha256"]) == 64 and document["versions"]["atom"]


@pytest.mark.report
def test_a_report_is_written_by_default_and_removed_with_the_results_that_it_was_of(
    made, tmp_path, capsys
):
    words = ["calibrate", "--dataset", made / "data" / "dataset.json", "--output", tmp_path / "out"]
    run(*words)
    out = capsys.readouterr().out
    assert f"report: {tmp_path / 'out' / 'report.html'}" in out
    assert names(tmp_path / "out") >= REPORTS
    run(*words, "--overwrite", "--no_report")
    assert not names(tmp_path / "out") & REPORTS  # it would show figures of another run


@pytest.mark.report
def test_evaluate_writes_one_with_the_calibration_that_it_measured(made, tmp_path, capsys):
    run(
        *("evaluate", "--train", made / "results" / "atom_calibration.json"),
        *("--test", made / "data" / "dataset.json", "--output", tmp_path / "out"),
    )
    assert "report: " in capsys.readouterr().out
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="pairs"' in text and 'id="moved"' in text


@pytest.mark.report
def test_ctrl_c_ends_the_drawing_and_goes_on_to_who_had_the_signal(made, tmp_path, monkeypatch):
    """ROS takes the signal for itself; drawing may last seconds, and roslaunch does not wait."""
    from atom_core.report.page import html

    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append("signal"))
    monkeypatch.setattr(html, "html", lambda page: os.kill(os.getpid(), signal.SIGINT))
    try:
        words = ["calibrate", "--dataset", made / "data" / "dataset.json"]
        run(*words, "--output", tmp_path / "out")
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == ["signal"]
    assert "calibration.json" in names(tmp_path / "out") and not names(tmp_path / "out") & REPORTS


@pytest.mark.long  # that of one alone is made where names are of any bytes
def test_report_is_made_from_the_files_of_both_results(made, tmp_path, capsys):
    output = tmp_path / "new" / "report"
    words = ["report", "--calibration", made / "results", "--evaluation", made / "evaluation"]
    run(*words, "--output", output)
    assert names(output) == REPORTS
    assert capsys.readouterr().out == f"report: {output / 'report.html'}\n"
    line = refused(capsys, *words, "--output", output)
    assert "--overwrite" in line and str(output) in line


def test_what_is_gone_is_left_out_and_said(made, tmp_path, capsys):
    shutil.copytree(made / "results", tmp_path / "results")  # the data are elsewhere now
    (tmp_path / "results" / "residuals.npz").write_bytes(b"broken")
    (tmp_path / "results" / "report.html").write_text("of before")
    run("report", "--calibration", tmp_path / "results", "--overwrite")
    out = capsys.readouterr().out
    assert "are gone" in out and "residuals.npz cannot be read" in out
    text = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "are gone" in text and "residuals.npz cannot be read" in text
    assert 'id="clouds"' not in text and 'id="moved"' in text


@pytest.mark.parametrize(
    "change, told",
    [
        (lambda path: path.unlink(), "there is no such result"),
        (lambda path: path.write_text("{"), "no JSON"),
        (lambda path: path.write_text('{"sensors": []}'), "'sensors' is absent or of another kind"),
    ],
)
def test_what_is_no_result_is_refused(made, tmp_path, capsys, change, told):
    shutil.copytree(made / "results", tmp_path / "results")
    change(tmp_path / "results" / "calibration.json")
    line = refused(capsys, "report", "--calibration", tmp_path / "results")
    assert told in line and "calibrate" in line and str(tmp_path / "results") in line
    assert not names(tmp_path / "results") & REPORTS


def test_results_without_some_value_are_refused_in_words(made, tmp_path, capsys):
    shutil.copytree(made / "results", tmp_path / "results")
    path = tmp_path / "results" / "calibration.json"
    document = json.loads(path.read_text())
    del next(iter(document["sensors"].values()))["residuals"]
    path.write_text(json.dumps(document))
    line = refused(capsys, "report", "--calibration", tmp_path / "results")
    assert "the report is not made" in line and "residuals" in line


@pytest.mark.report
def test_an_evaluation_is_not_shown_with_a_calibration_that_it_did_not_measure(
    made, tmp_path, capsys
):
    dataset, results = made / "data" / "dataset.json", tmp_path / "results"
    shutil.copytree(made / "results", results)
    run(
        *("evaluate", "--train", results / "atom_calibration.json", "--no_report"),
        *("--test", dataset, "--output", tmp_path / "evaluation"),
    )
    words = ["report", "--evaluation", tmp_path / "evaluation", "--output", tmp_path / "out", "-ow"]
    run(*words, "--calibration", made / "results")  # the same file elsewhere
    again = ["calibrate", "--dataset", dataset, "--output", results, "--overwrite", "--no_report"]
    run(*again, "-nig", "0.01", "0.01")
    told = refused(capsys, *words, "--calibration", results)
    assert f"evaluates another calibration than the one in {results}" in told
    assert "evaluate it again" in told
    run(*words)
    assert f"{results} holds another calibration by now" in capsys.readouterr().out
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="pairs"' in text and 'id="moved"' not in text


def test_a_result_has_to_be_named(capsys):
    assert "--calibration" in refused(capsys, "report")
