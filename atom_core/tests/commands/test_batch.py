"""Batches of experiments: folds, templates, what is run and collected, and averages."""

import json
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.errors import ConfigError, DatasetError  # noqa: E402
from atom_core.io.batch_files import batch_of  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.io.folds import KINDS, LEAVE_ONE_OUT, SHUFFLE_SPLIT, Fold, folds  # noqa: E402
from atom_core.report.batch_averages import averages, experiment_groups  # noqa: E402
from atom_core.synthetic import Noise, scenes  # noqa: E402

DATA = """\
dataset_path: {folder}
runs: [1, 2]
cross_validation: {{type: {kind}, n_splits: 2, train_size: 0.5}}
experiments: [{{name: first, value: 1.5}}, {{name: second, value: 2.5}}]
"""
TEMPLATE = """\
preprocessing:
  cmd: echo begun >> {made}/order
experiments:
{{%- for e in experiments %}}{{%- for run in runs %}}{{%- for fold in folds %}}
  {{{{ e.name }}}}_run{{{{ '%03d' % run }}}}_fold{{{{ '%03d' % loop.index }}}}:
    cmd: |
      printf 'Collection #,RMS (pix),note\\r\\n000,7,a\\r\\n' > {made}/table.csv
      echo 'Averages,{{{{ e.value + run + fold[0] | length }}}},---' >> {made}/table.csv
      echo "{{{{ e.name }}}} {{{{ fold[1] }}}}" >> {made}/order
      printf '\\033[31mred\\033[0m\\n'
    files_to_collect: ['{made}/table.csv']
{{%- endfor %}}{{%- endfor %}}{{%- endfor %}}
"""


@pytest.fixture(scope="module")
def dataset_folder(tmp_path_factory):
    """Return the folder of a dataset of ten collections, most of them incomplete."""
    noise = Noise.none()
    scene = scenes.random_scene(3, rgb=2, depth=0, lidar3d=0, collections=10, noise=noise)
    folder = tmp_path_factory.mktemp("data")
    write_dataset_folder(scene.dataset, folder, name="ten")
    return folder


@pytest.fixture
def batch(dataset_folder, tmp_path):
    """Return the words that run a batch, and the folder in which its commands write."""
    made = tmp_path / "made"
    made.mkdir()
    (tmp_path / "data.yml").write_text(DATA.format(folder=dataset_folder, kind="k-fold"))
    (tmp_path / "template.yml.j2").write_text(TEMPLATE.format(made=made))
    files = ["-tf", tmp_path / "template.yml.j2", "-df", tmp_path / "data.yml"]
    return ["batch_execution", *files, "-of", tmp_path / "out"], made


# ------------------------------------------------------------------------------------ folds


@pytest.mark.parametrize("kind", KINDS)
def test_every_collection_is_measured_on_and_never_by_what_it_calibrated(kind, dataset_folder):
    dataset = read_dataset(dataset_folder / "dataset.json")
    wanted = {"type": kind, "n_splits": 3, "train_size": 0.7}
    found = folds(dataset, wanted, seed=1)
    assert found == folds(dataset, wanted, seed=1)
    assert len(found) == (10 if kind == LEAVE_ONE_OUT else 3)
    for fold in found:
        assert sorted([*fold.train, *fold.test]) == sorted(dataset.collections)
    if kind == SHUFFLE_SPLIT:
        assert all(len(fold.train) == 7 for fold in found)
        assert folds(dataset, {**wanted, "train_size": 7}, seed=1) == found
    else:
        counts = Counter(key for fold in found for key in fold.test)
        assert set(counts.values()) == {1} and len(counts) == 10
    if kind != LEAVE_ONE_OUT:
        assert found != folds(dataset, wanted, seed=2)


def test_strata_are_shared_out_evenly(dataset_folder):
    dataset = read_dataset(dataset_folder / "dataset.json")
    half = list(dataset.collections)[:6]
    for key in half:
        dataset = dataset.with_labels(key, {("rgb_2", "pattern_1"): None})
    for fold in folds(dataset, {"type": "stratified-k-fold", "n_splits": 2}, seed=0):
        assert len(set(fold.test) & set(half)) == 3


def test_without_cross_validation_all_collections_are_in_both_parts(dataset_folder):
    dataset = read_dataset(dataset_folder / "dataset.json")
    keys = list(dataset.collections)
    assert folds(dataset, None, 0) == [Fold(keys, keys)]
    assert folds(dataset, {"type": None}, 0) == [Fold(keys, keys)]


@pytest.mark.parametrize(
    ("wanted", "says"),
    [
        ({"type": "thirds"}, "type 'thirds'; use one of stratified-k-fold"),
        ({"type": "k-fold"}, "needs n_splits, a whole number from 2 to 10"),
        ({"type": "k-fold", "n_splits": 11}, "it has 11"),
        ({"type": "k-fold", "n_splits": True}, "it has True"),
        ({"type": SHUFFLE_SPLIT, "n_splits": 2}, "needs train_size"),
        ({"type": SHUFFLE_SPLIT, "n_splits": 2, "train_size": 10}, "below 10; it has 10"),
    ],
)
def test_folds_that_cannot_be_are_refused(wanted, says, dataset_folder):
    dataset = read_dataset(dataset_folder / "dataset.json")
    with pytest.raises(ConfigError, match=says.replace("(", r"\(")):
        folds(dataset, wanted, 0, "data.yml")


# ---------------------------------------------------------------------------------- batches


def test_all_experiments_run_once_in_order_and_their_files_are_collected(batch, capsys):
    words, made = batch
    run(*words)
    out = words[-1]
    order = (made / "order").read_text().splitlines()
    assert order[0] == "begun" and len(order) == 9
    assert [line.split(" ")[0] for line in order[1:]] == ["first"] * 4 + ["second"] * 4
    folders = sorted(path.name for path in out.iterdir() if path.is_dir())
    assert folders[0] == "first_run001_fold001" and len(folders) == 8
    assert "Averages,7.5" in (out / folders[0] / "table.csv").read_text()  # 1.5 + run 1 + 5 of 10
    assert (out / folders[0] / "stdout.txt").read_text() == "red\n"
    record = json.loads((out / "batch.json").read_text())
    assert record["sample_seed"] == 0 and len(record["folds"]) == 2
    assert str(sorted(int(k) for k in record["folds"][0]["test"])) in order[1]
    assert "8 of 8 experiments are done" in capsys.readouterr().out
    run(*words)  # everything is done already
    assert len((made / "order").read_text().splitlines()) == 10  # the preprocessing again


def test_a_dry_run_runs_nothing(batch, capsys):
    words, made = batch
    run(*words, "-dr")
    assert "# preprocessing" in capsys.readouterr().out
    assert list(made.iterdir()) == [] and not words[-1].exists()


def test_an_interrupted_batch_goes_on_and_another_one_is_refused(batch, capsys):
    words, made = batch
    template = words[2]
    text = template.read_text()
    template.write_text(text.replace("    files", f"      test -e {made}/go\n    files"))
    run(*words, code=1)
    said = capsys.readouterr()
    assert "first_run001_fold001: its command ended with exit code 1" in said.err
    assert "0 of 8 experiments are done; failed: first_run001_fold001" in said.out
    run(*words, "-k", code=1)
    assert len((made / "order").read_text().splitlines()) == 2 + 1 + 8
    (made / "go").write_text("")
    run(*words)
    template.write_text(text)
    assert "holds a batch with other commands" in refused(capsys, *words)
    elsewhere = words[-1].rename(words[-1].with_name("disk"))
    words[-1].symlink_to(elsewhere)
    run(*words, "-ow")
    assert words[-1].is_symlink() and (elsewhere / "batch.json").is_file()


def test_a_file_of_an_earlier_experiment_is_not_collected(batch, capsys):
    words, made = batch
    template = words[2]
    (made / "old.csv").write_text("x")
    text = template.read_text()
    template.write_text(text.replace("table.csv']", f"table.csv', '{made / 'old.csv'}']"))
    run(*words, code=1)
    assert "was not written by the experiment" in capsys.readouterr().err


def test_overwriting_removes_nothing_but_a_batch(batch, capsys):
    words, _ = batch
    words[-1].mkdir()
    (words[-1] / "thesis.tex").write_text("")
    assert "holds no batch, and is left alone" in refused(capsys, *words, "-ow")
    assert (words[-1] / "thesis.tex").exists()


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("data.yml", "dataset_path", "path", "dataset_path is absent"),
        ("data.yml", "runs: [1, 2]", "runs: [1, 2", "not valid YAML"),
        ("data.yml", "runs", "folds", "'folds' is the name of what is added"),
        ("data.yml", "runs: [1, 2]", "runs: [1]\nruns: [2]", "'runs' stands here a second time"),
        ("template.yml.j2", "e.value", "e.weight", "'dict object' has no attribute 'weight'"),
        ("template.yml.j2", "endfor", "endfro", "unknown tag 'endfro'"),
        ("template.yml.j2", "experiments:\n", "batches:\n", "an older layout"),
        ("template.yml.j2", "    cmd: |", "    command: |", "needs 'cmd'"),
        ("template.yml.j2", "_fold{{ '%03d' % loop.index }}", "", "a second time"),
        ("template.yml.j2", "{{ e.name }}_run", "../{{ e.name }}_run", "cannot be the name"),
    ],
)
def test_a_batch_that_cannot_be_is_refused_in_one_line(batch, file, old, new, says, capsys):
    words, made = batch
    path = words[2 if file.startswith("template") else 4]
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    assert says in refused(capsys, *words)
    assert list(made.iterdir()) == []


MERGED = """\
defaults:
  table: {files: &files {files_to_collect: [a.csv], cmd: none}}
  run: {deep: {deeper: &run {<<: *files, cmd: first}}}
experiments:
  one: {<<: *run}
  two: {cmd: second, <<: *run}
"""


def test_a_map_may_take_over_the_keys_of_another_one_and_replace_them():
    one, two = batch_of(MERGED, "template").experiments
    assert (one.command, two.command) == ("first", "second")
    assert one.files == two.files == ("a.csv",)
    with pytest.raises(ConfigError, match="'cmd' stands here a second time"):
        batch_of(MERGED.replace("{cmd: second,", "{cmd: second, cmd: third,"), "template")


def test_results_beside_a_dataset_are_replaced_within_a_batch_alone(monkeypatch):
    from atom_core import cli
    from atom_core.commands.common import REPLACE_RESULTS

    line = ["calibrate", "-json", "a.json"]
    assert not cli.build_parser("calibrate").parse_args(line).overwrite
    monkeypatch.setenv(REPLACE_RESULTS, "1")
    assert cli.build_parser("calibrate").parse_args(line).overwrite
    line = ["recover", "FOLDER"]
    assert not getattr(cli.build_parser("recover").parse_args(line), "overwrite", False)


# --------------------------------------------------------------------------------- averages


def test_averages_are_those_of_all_runs_and_folds_of_one_experiment(batch, tmp_path, capsys):
    words, _ = batch
    run(*words)
    target = tmp_path / "averages"
    run("process_results", "-rf", words[-1], "-of", target)
    lines = (target / "first" / "table.csv").read_text().splitlines()
    assert lines == [",0", "Collection #,Averages", "RMS (pix),8.0"]  # 7.5 and 8.5, twice each
    table = [line.split(",") for line in (target / "averages.csv").read_text().splitlines()]
    assert table[0][:3] == ["experiment", "file", "column"] and len(table) == 3
    assert table[2][:4] == ["second", "table.csv", "RMS (pix)", "9.0"] and table[2][5] == "4"
    assert float(table[1][4]) == pytest.approx((1.0 / 3.0) ** 0.5)
    (words[-1] / "first_run002_fold001" / "table.csv").unlink()
    assert "not empty" in refused(capsys, "process_results", "-rf", words[-1], "-of", target)
    run("process_results", "-rf", words[-1], "-of", target, "-ow", code=1)
    assert "first_run002_fold001: table.csv is missing" in capsys.readouterr().err


def test_names_that_begin_alike_are_not_one_experiment():
    names = ["nig_0.1_run001_fold001", "nig_0.15_run001_fold001", "nig_0.1_run002_fold001", "plain"]
    groups = experiment_groups(names, ["_run", "_fold"])
    assert {k: len(v) for k, v in groups.items()} == {"nig_0.1": 2, "nig_0.15": 1, "plain": 1}


def test_a_table_without_the_column_or_the_row_is_refused(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "t.csv").write_text("Joint,Error\nj,1\n")
    with pytest.raises(DatasetError, match="no line has 'Averages' in column 'Joint'"):
        averages(tmp_path, {"a": ["a"]})
    with pytest.raises(DatasetError, match="no column 'Collection #'; there are: Joint, Error"):
        averages(tmp_path, {"a": ["a"]}, column="Collection #")


def test_an_experiment_of_which_every_repetition_failed_is_named(batch, tmp_path, capsys):
    words, _ = batch
    run(*words)
    for path in words[-1].glob("second_*/table.csv"):
        path.unlink()
    run("process_results", "-rf", words[-1], "-of", tmp_path / "averages", code=1)
    assert "no repetition of experiment 'second' has a table" in capsys.readouterr().err


def test_runs_and_folds_may_stand_in_any_order():
    names = ["x_fold001_run001", "x_run002_fold001", "x_run003", "x"]
    assert experiment_groups(names, ["_run", "_fold"]) == {"x": sorted(names)}


def test_each_pair_of_a_table_has_averages_of_its_own(tmp_path):
    (tmp_path / "a").mkdir()
    table = tmp_path / "a" / "rgb-rgb.csv"
    table.write_text(
        "source,target,collection,RMS (pix)\na,b,000,9\na,b,Averages,1\na,c,Averages,2\n"
    )
    found = averages(tmp_path, {"a": ["a"]})
    assert [(a.column, a.mean) for a in found] == [("b RMS (pix)", 1.0), ("c RMS (pix)", 2.0)]
    table.write_text("collection,RMS (pix)\nAverages,1\nAverages,2\n")
    with pytest.raises(DatasetError, match="nothing tells them apart"):
        averages(tmp_path, {"a": ["a"]})


def test_what_a_command_leaves_in_the_background_does_not_hold_up_the_batch(batch, monkeypatch):
    monkeypatch.setattr("atom_core.commands.batch_execution._LAST_WORDS_S", 0.2)
    words, made = batch
    template = Path(words[2])
    template.write_text(template.read_text().replace("echo begun", "sleep 30 & echo begun"))
    started_s = time.monotonic()
    run(*words)
    assert time.monotonic() - started_s < 25.0
    assert len((made / "order").read_text().splitlines()) == 9
