"""ATOM's evaluations of one pair give the figures of `evaluate`, under ATOM's columns."""

import csv
import json

import pytest

from atom_core import cli
from atom_core.commands.pair_evaluation import EVALUATORS
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

PAIRS = {
    "rgb_to_rgb_evaluation": ("rgb_1", "rgb_2"),
    "lidar_to_rgb_evaluation": ("lidar_1", "rgb_1"),
    "lidar_to_depth_evaluation": ("lidar_1", "depth_1"),
    "depth_to_rgb_evaluation": ("depth_1", "rgb_2"),
    "lidar_to_lidar_evaluation": ("lidar_1", "lidar_2"),
}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Return a dataset, whose transforms are off by a little, and what `evaluate` says of it."""
    folder = tmp_path_factory.mktemp("pairs")
    scene = scenes.random_scene(4, lidar3d=2, collections=6, disturbance=(0.01, 0.01))
    path = write_dataset_folder(scene.dataset, folder / "data", name="pairs")
    line = ["evaluate", "--train", path, "--test", path, "--output", folder / "all"]
    assert cli.main([str(word) for word in line]) == 0
    return path, json.loads((folder / "all" / "evaluation.json").read_text())["pairs"]


def line_of(name, path, source, target):
    tool = EVALUATORS[name]
    files = ["-train_json", str(path), "-test_json", str(path)]
    return [name, *files, f"-{tool.source[0]}", source, f"-{tool.target[0]}", target]


@pytest.mark.parametrize("name", PAIRS)
def test_the_figures_are_those_of_evaluate(data, tmp_path, name, capsys):
    path, pairs = data
    source, target = PAIRS[name]
    line = [*line_of(name, path, source, target), "-uic", "-sfrn", str(tmp_path / "a.csv")]
    assert cli.main([*line, "-si", "-csf", "lambda x: int(x) < 90"]) == 0
    assert "note: -si has no meaning here, because" in capsys.readouterr().err
    ends = (EVALUATORS[name].kind, source, target)
    (wanted,) = [p for p in pairs if (p["kind"], p["source"], p["target"]) == ends]
    header, *rows = csv.reader((tmp_path / "a.csv").read_text().splitlines())
    assert header[0] == "Collection #"
    factor = 1e-3 if "(m)" in header[1] else 1.0
    assert {row[0]: float(row[1]) for row in rows[:-1]} == pytest.approx(
        {key: factor * value["rms"] for key, value in wanted["per_collection"].items()}, abs=6e-5
    )
    assert rows[-1][0] == "Averages"
    assert float(rows[-1][1]) == pytest.approx(factor * wanted["rms"], abs=6e-5)


def test_depth_cameras_and_lidars_have_atom_s_deviations(data, tmp_path):
    path, pairs = data
    for name, unit, factor in (
        ("lidar_to_depth_evaluation", "pix", 1.0),
        ("lidar_to_lidar_evaluation", "m", 1e-3),
    ):
        line = [*line_of(name, path, *PAIRS[name]), "-uic", "-sfrn", str(tmp_path / f"{name}.csv")]
        assert cli.main(line) == 0
        header, *rows = csv.reader((tmp_path / f"{name}.csv").read_text().splitlines())
        titles = [f"{axis} {what} ({unit})" for what in ("err", "StDev") for axis in "XY"]
        assert header == ["Collection #", f"RMS ({unit})", *titles]
        ends = (EVALUATORS[name].kind, *PAIRS[name])
        (wanted,) = [p for p in pairs if (p["kind"], p["source"], p["target"]) == ends]
        figures = [wanted[f"{axis}_{what}_abs"] for what in ("mean", "std") for axis in "xy"]
        assert [float(text) for text in rows[-1][2:]] == pytest.approx(
            [factor * figure for figure in figures], abs=6e-5
        )


def test_without_a_name_the_file_lies_in_results_beside_the_test_set(data, capsys):
    path, _ = data
    line = [*line_of("rgb_to_rgb_evaluation", path, "rgb_1", "rgb_2"), "-uic", "-sfr"]
    made = path.parent / "results" / "dataset_rgb_1_to_rgb_2_results.csv"
    assert cli.main(line) == 0
    assert made.read_bytes().startswith(
        b"Collection #,RMS (pix),X err (pix),Y err (pix),Trans (mm),Rot (deg)\r\n"
    )
    capsys.readouterr()
    assert cli.main(line) == 2
    assert "exists already" in capsys.readouterr().err
    assert cli.main([*line, "-ow"]) == 0


def test_what_cannot_be_measured_is_refused_in_one_line(data, capsys):
    path, _ = data
    for pair, words in (
        (("rgb_1", "rgb_9"), "no sensor 'rgb_9'"),
        (("lidar_1", "rgb_1"), "no pair of rgb-rgb"),
    ):
        assert cli.main([*line_of("rgb_to_rgb_evaluation", path, *pair), "-uic"]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1


def without_lidar_2(path, complete):
    """Write a dataset in which so many collections are complete; return it and their keys."""
    document = json.loads(path.read_text())
    whole = []
    for key, collection in document["collections"].items():
        labels = collection["labels"]["pattern_1"]
        if all(label["detected"] for label in labels.values()) and len(whole) < complete:
            whole.append(key)
        else:
            labels["lidar_2"].update(detected=False, idxs=[], idxs_limit_points=[])
    other = path.with_name(f"complete_{complete}.json")
    other.write_text(json.dumps(document))
    assert len(whole) == complete
    return other, whole


def collections_of(csv_file):
    return [row[0] for row in csv.reader(csv_file.read_text().splitlines())][1:-1]


def test_only_complete_collections_count_unless_asked(data, tmp_path):
    """As in ATOM: `-uic` keeps the others."""
    path, pairs = data
    other, whole = without_lidar_2(path, complete=1)
    line = line_of("rgb_to_rgb_evaluation", other, "rgb_1", "rgb_2")
    assert cli.main([*line, "-sfrn", str(tmp_path / "a.csv")]) == 0
    assert collections_of(tmp_path / "a.csv") == whole
    assert cli.main([*line, "-uic", "-sfrn", str(tmp_path / "b.csv")]) == 0
    (both,) = [p for p in pairs if (p["source"], p["target"]) == ("rgb_1", "rgb_2")]
    assert collections_of(tmp_path / "b.csv") == list(both["per_collection"])
    assert len(both["per_collection"]) > 1


def test_where_no_collection_is_complete_the_option_is_named(data, tmp_path, capsys):
    other, _ = without_lidar_2(data[0], complete=0)
    line = line_of("rgb_to_rgb_evaluation", other, "rgb_1", "rgb_2")
    assert cli.main([*line, "-sfrn", str(tmp_path / "a.csv")]) == 2
    assert "-uic" in capsys.readouterr().err
    assert not (tmp_path / "a.csv").exists()


def test_partial_labels_leave_a_collection_to_the_other_sensors(data, tmp_path):
    """As in ATOM: `-rpd` comes after the question which collections are complete."""
    path, _ = data
    document = json.loads(path.read_text())
    for collection in document["collections"].values():
        of_camera = collection["labels"]["pattern_1"]["rgb_1"]
        of_camera["idxs"] = of_camera["idxs"][1:]  # this camera keeps no whole label
    partial = path.with_name("partial.json")
    partial.write_text(json.dumps(document))
    tables = []
    for options in ([], ["-rpd"]):
        table = tmp_path / f"{len(tables)}.csv"
        line = line_of("lidar_to_depth_evaluation", partial, "lidar_1", "depth_1")
        assert cli.main([*line, "-sfrn", str(table), *options]) == 0
        tables.append(table.read_text())
    assert tables[0] == tables[1]
    line = line_of("rgb_to_rgb_evaluation", partial, "rgb_1", "rgb_2")
    assert cli.main([*line, "-rpd"]) == 2  # it measures what is left out
