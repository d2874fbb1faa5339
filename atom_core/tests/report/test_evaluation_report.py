"""Tables, CSV files and document of an evaluation."""

import csv
import io
import json
from dataclasses import replace

import pytest

from atom_core.evaluation.evaluate import evaluate
from atom_core.io.atomic import write_json_atomically
from atom_core.model.dataset import DataSource
from atom_core.report.evaluation_csv import csv_texts
from atom_core.report.evaluation_document import evaluation_document
from atom_core.report.evaluation_tables import evaluation_report
from atom_core.synthetic import paper_cell

FIGURES = ("rms", "pooled_rms", "mean", "median")


@pytest.fixture(scope="module")
def cells():
    return paper_cell(2, "test"), paper_cell(2, "test", disturbance=(0.02, 0.01))


@pytest.fixture(scope="module")
def evaluation(cells):
    return evaluate(cells[0].dataset, cells[0].dataset, truth=cells[0].truth)


@pytest.fixture(scope="module")
def worse(cells):
    return evaluate(cells[1].dataset, cells[0].dataset, truth=cells[0].truth)


@pytest.fixture(scope="module")
def without_data(cells):
    bare = replace(cells[0].dataset, data=DataSource())
    return evaluate(bare, bare)


def test_document_has_the_keys_of_the_interface(evaluation):
    document = evaluation_document(evaluation)
    assert document["version"] == "1.0" and document["baselines"] == {}
    for pair in document["pairs"]:
        assert {"source", "target", "kind", "metric", "unit", "collections", "points"} < set(pair)
        assert {"at_truth", "per_collection", "skipped", "reverse", *FIGURES} < set(pair)
        assert pair["skipped"] is None and pair["collections"] == len(pair["per_collection"])
        assert pair["points"] == sum(c["points"] for c in pair["per_collection"].values())
        assert set(FIGURES) <= set(pair["at_truth"])
        extra = {"x_mean_abs", "y_mean_abs", "translation_mm", "rotation_deg"}
        assert (extra <= set(pair)) == (pair["kind"] == "rgb-rgb")
    assert document["averages"]["rgb-rgb"]["unit"] == "px"
    assert document["averages"]["lidar3d-lidar3d"]["unit"] == "mm"
    assert document["averages"]["lidar3d-rgb"]["pairs"] == 9
    assert set(document["ground_truth"]["mean"]) == {"translation_error_m", "rotation_error_deg"}
    assert "world_translation_error_m" in document["ground_truth"]["lidar_1"]


def test_document_is_strict_json(tmp_path, evaluation, worse, without_data):
    for name, document in {
        "one.json": evaluation_document(evaluation, worse),
        "bare.json": evaluation_document(without_data),
    }.items():
        write_json_atomically(tmp_path / name, document)
        assert json.loads((tmp_path / name).read_text())["pairs"]


def test_skipped_pairs_have_a_reason_and_no_figures(without_data):
    skipped = [p for p in evaluation_document(without_data)["pairs"] if p["kind"] == "lidar3d-rgb"]
    assert len(skipped) == 9
    for pair in skipped:
        assert "is absent" in pair["skipped"] and pair["collections"] == pair["points"] == 0
        assert all(pair[name] is None for name in FIGURES)


def test_another_calibration_stands_in_the_document(evaluation, worse):
    document = evaluation_document(evaluation, worse)
    other = document["compared_with"]
    assert other["averages"]["rgb-rgb"]["rms"] == worse.averages["rgb-rgb"].values["rms"]
    assert other["averages"]["rgb-rgb"]["rms"] > document["averages"]["rgb-rgb"]["rms"]


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_one_csv_for_each_kind_with_a_line_for_each_collection_and_pair(evaluation):
    texts = csv_texts(evaluation)
    assert set(texts) == {f"{r.pair.kind.name}.csv" for r in evaluation.pairs}
    rows = rows_of(texts["rgb-rgb.csv"])
    lines = sum(len(r.measured.rows) + 1 for r in evaluation.pairs if r.pair.kind.name == "rgb-rgb")
    assert len(rows) == lines
    keys = [(r["source"], r["target"], r["pattern"], r["Collection #"]) for r in rows]
    assert len(set(keys)) == len(keys)


def test_csv_of_cameras_has_atoms_columns(evaluation):
    header = csv_texts(evaluation)["rgb-rgb.csv"].splitlines()[0]
    atom = "Collection #,RMS (pix),X err (pix),Y err (pix),Trans (mm),Rot (deg)"
    assert header.startswith("source,target,pattern," + atom)


def test_csv_holds_the_figures(evaluation):
    result = next(r for r in evaluation.pairs if r.pair.kind.name == "lidar3d-lidar3d_plane")
    rows = [
        r
        for r in rows_of(csv_texts(evaluation)["lidar3d-lidar3d_plane.csv"])
        if (r["source"], r["target"]) == (result.pair.source, result.pair.target)
    ]
    average = next(r for r in rows if r["Collection #"] == "Averages")
    assert float(average["RMS (mm)"]) == pytest.approx(result.measured.rms, abs=1e-4)
    assert float(average["RMS at truth"]) == pytest.approx(result.at_truth.rms, abs=1e-4)


def test_report_says_everything_once(evaluation):
    text = evaluation_report(evaluation)
    for title in ("Pairs of cameras", "Pairs with a range sensor", "Averages over the pairs"):
        assert text.count(title) == 1
    assert "Errors against the truth" in text and "RMS at truth" in text
    assert "Skipped" not in text and "of the other" not in text


def test_report_names_what_was_skipped(without_data):
    text = evaluation_report(without_data)
    assert "Skipped" in text and "the data file of 'lidar_1' is absent" in text
    assert "Pairs with a range sensor" not in text and "at truth" not in text


def test_report_with_another_calibration_and_every_collection(evaluation, worse):
    text = evaluation_report(evaluation, worse, verbose=True)
    assert "RMS of the other" in text and "other: translation [mm]" in text
    assert "rgb-rgb [px]: rgb_3 -> rgb_1" in text
