"""ATOM's tools for datasets: nothing is lost, nothing is made up, the input stays as it was."""

import json
import math
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core import cli  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_tools import joint_clusters, with_sensor_renamed  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import Noise, arm, scenes  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with a dataset of two cameras and a LiDAR, all data files in it."""
    folder = tmp_path_factory.mktemp("made")
    scene = scenes.random_scene(2, depth=0, lidar3d=1, collections=7, noise=Noise.none())
    boards = {("pattern_1", "000"): ("rgb_1", np.eye(4))}
    write_dataset_folder(scene.dataset, folder / "data", name="seven", initial_boards=boards)
    return folder / "data"


@pytest.fixture
def path(made, tmp_path):
    shutil.copytree(made, tmp_path / "data")
    return tmp_path / "data" / "dataset.json"


def document_of(path):
    return json.loads(path.read_text())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("percent", [30, 50, 72])
def test_the_parts_of_a_split_are_the_whole(path, percent, seed):
    run("split_atom_dataset", "-json", path, "-tp", percent, "-ss", seed)
    whole = document_of(path)
    train, test = (document_of(path.with_name(f"dataset_{p}.json")) for p in ("train", "test"))
    assert len(train["collections"]) == math.floor(7 * percent / 100)
    assert {**train["collections"], **test["collections"]} == whole["collections"]
    assert not set(train["collections"]) & set(test["collections"])
    assert train["_metadata"]["dataset_name"] == "seven_train"
    for part in (train, test):
        initial = part["patterns"]["pattern_1"]["transforms_initial"]
        assert set(initial) == set(part["collections"])
    run("split_atom_dataset", "-json", path, "-tp", percent, "-ss", seed, "-ow")
    assert document_of(path.with_name("dataset_train.json")) == train  # of the same seed
    assert document_of(path) == whole


def test_a_split_is_alike_in_what_is_seen(path):
    """Half of the collections without the LiDAR: so is half of each part."""
    document = document_of(path)
    seen = [k for k, c in document["collections"].items() if label(c)["detected"]]
    for key in seen[: len(seen) // 2]:
        label(document["collections"][key]).update(detected=False, idxs=[], idxs_limit_points=[])
    path.write_text(json.dumps(document))
    there = len(seen) - len(seen) // 2
    for seed in range(5):
        run("split_atom_dataset", "-json", path, "-tp", 58, "-ss", seed, "-ow")
        train = read_dataset(path.with_name("dataset_train.json"))
        count = sum(key.sensor == "lidar_1" for key, _ in train.detections())
        assert abs(count - there * 4 / 7) < 1.5


def label(collection):
    return collection["labels"]["pattern_1"]["lidar_1"]


def test_a_split_that_blinds_a_sensor_is_refused(path, capsys):
    document = document_of(path)
    for key in list(document["collections"])[1:]:
        label(document["collections"][key]).update(detected=False, idxs=[], idxs_limit_points=[])
    assert label(document["collections"]["000"])["detected"]
    path.write_text(json.dumps(document))
    assert "leaves sensor 'lidar_1'" in refused(
        capsys, "split_atom_dataset", "-json", path, "-tp", "50"
    )
    for percent in (0, 5, 100):
        assert "both parts need one" in refused(
            capsys, "split_atom_dataset", "-json", path, "-tp", percent
        )
    assert sorted(p.name for p in path.parent.glob("*.json")) == ["dataset.json"]


def test_what_was_split_merges_into_the_same(path, tmp_path):
    run("split_atom_dataset", "-json", path, "-tp", "50")
    parts = [path.with_name(f"dataset_{part}.json") for part in ("train", "test")]
    run("merge_atom_datasets", "-ds1", parts[0], "-ds2", parts[1], "-dof", tmp_path / "new")
    new = read_dataset(tmp_path / "new" / "dataset.json")
    old = read_dataset(path)
    order = [key for part in parts for key in read_dataset(part).collections]
    names = list(read_dataset(parts[0]).collections)
    begin = int(max(names)) + 1
    names += [f"{begin + i:03d}" for i in range(len(order) - len(names))]
    assert list(new.collections) == names
    first = new.document["patterns"]["pattern_1"]["transforms_initial"]
    assert set(first) == set(names)
    for before, after in zip(order, names):
        a, b = old.collections[before], new.collections[after]
        assert {k: v.summary(old.patterns[k[1]]) for k, v in a.labels.items()} == {
            k: v.summary(new.patterns[k[1]]) for k, v in b.labels.items()
        }
        np.testing.assert_array_equal(
            old.data.read(before, "lidar_1"), new.data.read(after, "lidar_1")
        )
        stored = old.document["patterns"]["pattern_1"]["transforms_initial"][before]
        assert first[after] == stored
    assert cli.main(["check", "--dataset", str(new.source)]) == 0


def test_a_merged_dataset_has_what_is_in_doubt_of_both_and_a_renamed_sensor_keeps_it(
    path, tmp_path
):
    run("split_atom_dataset", "-json", path, "-tp", "50")
    parts = [path.with_name(f"dataset_{part}.json") for part in ("train", "test")]
    common = {"sensors": ["rgb_1"], "what": "a", "remedy": "b"}
    for part, caveats in zip(parts, ([common], [common, {**common, "sensors": ["rgb_2"]}])):
        document = document_of(part)
        document["_metadata"]["caveats"] = caveats
        part.write_text(json.dumps(document))
    run("merge_atom_datasets", "-ds1", parts[0], "-ds2", parts[1], "-dof", tmp_path / "new")
    new = read_dataset(tmp_path / "new" / "dataset.json")
    assert [c.sensors for c in new.caveats] == [("rgb_1",), ("rgb_2",)]
    renamed = with_sensor_renamed(new.document, "rgb_1", "front")
    assert [c["sensors"] for c in renamed["_metadata"]["caveats"]] == [["front"], ["rgb_2"]]


def described_board(document):
    return document["calibration_config"]["calibration_patterns"]["pattern_1"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["sensors"]["rgb_1"]["camera_info"]["K"].__setitem__(0, 9.0), "camera_info"),
        (lambda d: d["sensors"]["rgb_2"].update(calibration_child="x"), "calibrated edge"),
        (lambda d: d["sensors"].pop("rgb_2"), "the sensors differ"),
        (
            lambda d: d["calibration_config"]["calibration_patterns"]["pattern_1"].update(
                fixed=True
            ),
            "another board",
        ),
        (lambda d: described_board(d).update(border_size={"x": 0.3, "y": 0.3}), "another board"),
        (
            lambda d: d["calibration_config"].update(
                joints={"elbow": {"params_to_calibrate": ["position_bias"]}}
            ),
            "the joints to be estimated differ (none; elbow)",
        ),
        (
            lambda d: d["calibration_config"].update(
                additional_tfs={"base": {"parent_link": "world", "child_link": "base"}}
            ),
            "the additional_tfs differ (none; base)",
        ),
    ],
)
def test_rigs_that_differ_are_not_merged(path, tmp_path, capsys, change, words):
    document = document_of(path)
    change(document)
    other = path.with_name("other.json")
    other.write_text(json.dumps(document))
    line = ["merge_atom_datasets", "-ds1", path, "-ds2", other, "-dof", tmp_path / "new"]
    assert words in refused(capsys, *line)
    assert not (tmp_path / "new").exists()


def parts_of(path):
    run("split_atom_dataset", "-json", path, "-tp", "50")
    return [path.with_name(f"dataset_{part}.json") for part in ("train", "test")]


@pytest.mark.parametrize("odometry", [True, False])
def test_an_edge_that_stands_elsewhere_in_the_other_dataset_is_multiple_when_they_are_merged(
    path, tmp_path, capsys, odometry
):
    parts = parts_of(path)
    edge, changed = "world-rig_base", document_of(parts[1])
    for part in parts:
        document = document_of(part)
        if odometry:
            entry = {"parent_link": "world", "child_link": "rig_base"}
            document["calibration_config"]["additional_tfs"] = {"odometry": entry}
        if part == parts[1]:
            for collection in document["collections"].values():
                collection["transforms"][edge]["trans"][0] += 1.0
                sensor = read_dataset(part).sensors["rgb_2"].edge
                collection["transforms"][str(sensor)]["trans"][0] += 0.01
        part.write_text(json.dumps(document))
    run("merge_atom_datasets", "-ds1", parts[0], "-ds2", parts[1], "-dof", tmp_path / "new")
    told = capsys.readouterr().out
    assert ("additional tf 'odometry' stands elsewhere" in told) == odometry
    types = document_of(tmp_path / "new" / "dataset.json")["transforms"]
    assert [name for name, entry in types.items() if entry["type"] == "multiple"] == [edge]
    assert changed["transforms"][edge]["type"] == "fixed"


def test_edges_that_stand_still_in_both_stay_fixed(path, tmp_path, capsys):
    parts = parts_of(path)
    run("merge_atom_datasets", "-ds1", parts[0], "-ds2", parts[1], "-dof", tmp_path / "new")
    types = document_of(tmp_path / "new" / "dataset.json")["transforms"]
    assert types == document_of(path)["transforms"]
    assert "warning" not in capsys.readouterr().out


def test_joints_that_a_calibration_has_corrected_in_one_of_two_datasets_are_told(tmp_path, capsys):
    scene = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.02}}, collections=4)
    raw = write_dataset_folder(scene.dataset, tmp_path / "raw", name="raw")
    solved = scene.dataset.with_joint_parameters({"elbow": {"position_bias": 0.02}})
    calibrated = write_dataset_folder(solved, tmp_path / "calibrated", name="calibrated")
    run("merge_atom_datasets", "-ds1", calibrated, "-ds2", raw, "-dof", tmp_path / "new")
    assert f"warning: elbow of {raw} have another origin, bias or axis" in capsys.readouterr().out
    merged = tmp_path / "new" / "dataset.json"
    line = refused(capsys, "calibrate", "-json", merged, "-o", tmp_path / "out")
    assert "differ between collections 000 and 004" in line
    assert "merge datasets as they were collected" in line
    run("merge_atom_datasets", "-ds1", raw, "-ds2", raw, "-dof", tmp_path / "same")
    assert "another origin" not in capsys.readouterr().out


def test_datasets_without_their_images_can_be_merged(path, tmp_path, capsys):
    parts = parts_of(path)
    count = len(document_of(parts[1])["collections"])
    for image in path.parent.glob("*.jpg"):
        image.unlink()
    run("merge_atom_datasets", "-ds1", parts[0], "-ds2", parts[1], "-dof", tmp_path / "new")
    assert f"{2 * count} data files of {parts[1]} are absent" in capsys.readouterr().out
    collections = document_of(tmp_path / "new" / "dataset.json")["collections"]
    names = [entry["data_file"] for c in collections.values() for entry in c["data"].values()]
    assert len(names) == len(set(names)) == 3 * len(collections)
    assert len(read_dataset(tmp_path / "new" / "dataset.json").collections) == len(collections)


def test_a_cloud_that_a_label_needs_is_not_left_out_of_a_merged_dataset(path, tmp_path, capsys):
    parts = parts_of(path)
    for cloud in path.parent.glob("lidar_1*"):
        cloud.unlink()
    line = ["merge_atom_datasets", "-ds1", parts[0], "-ds2", parts[1], "-dof", tmp_path / "new"]
    assert "sensor 'lidar_1'" in refused(capsys, *line)
    assert not (tmp_path / "new").exists()


def test_collections_that_are_in_both_are_told(path, tmp_path, capsys):
    run("split_atom_dataset", "-json", path, "-tp", "50")
    train, test = (path.with_name(f"dataset_{part}.json") for part in ("train", "test"))
    capsys.readouterr()
    line = ["merge_atom_datasets", "-ds1", train, "-dof"]
    run(*line, tmp_path / "apart", "-ds2", test)
    assert "warning" not in capsys.readouterr().out
    run(*line, tmp_path / "twice", "-ds2", path)
    told = capsys.readouterr().out
    known, both = (list(document_of(file)["collections"]) for file in (train, path))
    assert f"{len(known)} of {len(both)} collections" in told and "counts twice" in told
    assert ", ".join(known[:5]) in told


def test_collections_are_kept_as_selected(path, tmp_path, capsys):
    tool = ["remove_collections_from_atom_dataset", "-json", path]
    run(*tool, "-csf", "lambda x: int(x) in [1, 4]")
    assert list(document_of(path.with_name("dataset_filtered.json"))["collections"]) == [
        "001",
        "004",
    ]
    assert "exists already" in refused(capsys, *tool, "-csf", "000")
    assert "is the input" in refused(capsys, *tool, "-csf", "000", "-o", path, "-ow")
    elsewhere = tmp_path / "elsewhere" / "few.json"
    elsewhere.parent.mkdir()
    run(*tool, "-csf", "!000", "-o", elsewhere)
    few = read_dataset(elsewhere)
    assert len(few.collections) == 6
    assert few.data.read("001", "lidar_1").shape[1] == 3  # names its data from there


def test_a_renamed_sensor_is_the_same_everywhere(path, capsys):
    tool = ["rename_sensor", "-json", path]
    run(*tool, "-s", "rgb_1", "-n", "left")
    before, after = read_dataset(path), read_dataset(path.with_name("dataset_renamed.json"))
    assert "rgb_1" not in path.with_name("dataset_renamed.json").read_text().replace(
        "rgb_1_", ""
    ).replace("/rgb_1/", "")
    assert after.config.anchored_sensor == "left" and after.sensors["left"].name == "left"
    seen = [{k for k, _ in d.detections()} for d in (before, after)]
    assert {(k.collection, k.sensor.replace("rgb_1", "left")) for k in seen[0]} == {
        (k.collection, k.sensor) for k in seen[1]
    }
    assert "there is no sensor 'x'" in refused(capsys, *tool, "-s", "x", "-n", "y", "-ow")
    assert "a sensor 'rgb_2' already" in refused(capsys, *tool, "-s", "rgb_1", "-n", "rgb_2", "-ow")
    assert "is no name to be used" in refused(capsys, *tool, "-s", "rgb_1", "-n", "a b", "-ow")


def test_a_truth_is_kept_beside_the_transforms(path, capsys):
    true = path.with_name("true.json")
    run("add_ground_truth_to_dataset", "-ji", path, "-jo", true)
    for collection in document_of(true)["collections"].values():
        assert collection["transforms_ground_truth"] == collection["transforms"]
    again = ["add_ground_truth_to_dataset", "-ji", true, "-jo", path.with_name("b.json")]
    assert "already" in refused(capsys, *again)


def test_a_dataset_and_its_folder_are_renamed(path, capsys):
    (path.parent / "notes.json").write_text("[1]")
    run("rename_atom_dataset", "-d", path.parent, "-n", "train")
    moved = path.parent.with_name("train")
    assert document_of(moved / "dataset.json")["_metadata"]["dataset_name"] == "train"
    assert (moved / "notes.json").read_text() == "[1]" and not path.parent.exists()
    assert "exists already" in refused(capsys, "rename_atom_dataset", "-d", moved, "-n", "train")


def test_a_dataset_of_version_2_is_updated(path, capsys):
    whole = document_of(path)
    old = document_of(path)
    old["_metadata"]["version"] = "2.0"
    config = old["calibration_config"]
    config["calibration_pattern"] = config.pop("calibration_patterns")["pattern_1"]
    old["patterns"] = old["patterns"]["pattern_1"]
    for collection in old["collections"].values():
        collection["labels"] = collection["labels"]["pattern_1"]
    path.write_text(json.dumps(old))
    run("update_dataset_from_version_2_to_3", "-json", path, "-pn", "cell", "-cpn", "board")
    new = read_dataset(path.with_name("dataset_version_3.json"))
    assert list(new.patterns) == ["board"] and new.config.package_name == "cell"
    assert len(list(new.detections())) == sum(
        entry["detected"]
        for collection in whole["collections"].values()
        for entry in collection["labels"]["pattern_1"].values()
    )
    assert new.document["patterns"]["board"] == whole["patterns"]["pattern_1"]
    assert document_of(path) == old
    del old["collections"]["000"]["labels"]["rgb_1"]["idxs"]
    path.write_text(json.dumps(old))
    again = ["update_dataset_from_version_2_to_3", "-json", path, "-ow"]
    assert "cannot be updated" in refused(capsys, *again)


def test_inspection_tells_what_is_seen(path, capsys):
    run("inspect_atom_dataset", "-json", path, "-csf", "000", "001")
    out = capsys.readouterr().out
    dataset = read_dataset(path)
    for key in ("000", "001"):
        row = next(line for line in out.splitlines() if line.startswith(f"{key}  "))
        missing = len(dataset.sensors) - len(dataset.collections[key].labels)
        assert row.count("not detected") == missing
    assert "complete: " in out and "002" not in out


def test_joints_are_inspected_and_collections_grouped_by_them(tmp_path, capsys):
    scene = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.0}}, collections=4)
    path = write_dataset_folder(scene.dataset, tmp_path / "arm", name="arm")
    run("inspect_atom_dataset", "-json", path)
    assert "Positions of the joints" in capsys.readouterr().out
    dataset = read_dataset(path)
    positions = {key: c.joints["elbow"].position for key, c in dataset.collections.items()}
    for distance in (0.0, 0.05, 0.2, 10.0):
        clusters = joint_clusters(dataset, "elbow", distance)
        assert sorted(key for keys in clusters.values() for key in keys) == sorted(positions)
        group = {key: number for number, keys in clusters.items() for key in keys}
        for a in positions:
            near = [b for b in positions if b != a and abs(positions[a] - positions[b]) <= distance]
            assert (group[a] == -1) == (not near)
            assert all(group[b] == group[a] for b in near)
    run("filter_dataset_based_on_joint_states", "-json", path, "-j", "elbow", "-t", "10")
    assert (
        document_of(path.with_name("dataset_elbow_0.json"))["collections"].keys()
        == positions.keys()
    )
    wrong = ["filter_dataset_based_on_joint_states", "-json", path, "-j", "knee"]
    assert "no joint 'knee'" in refused(capsys, *wrong)
