"""What `check` says of a dataset that can be read and is not as it should be."""

import json

import pytest

from atom_core.cli import main
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    scene = scenes.random_scene(1, rgb=2, depth=0, lidar3d=1, collections=5)
    return write_dataset_folder(
        scene.dataset, tmp_path_factory.mktemp("data"), name="a", overwrite=True
    )


def said_of(given, capsys, change):
    """Return what is said of the dataset after a change of its document."""
    document = json.loads(given.read_text())
    change(document)
    path = given.with_name("changed.json")
    path.write_text(json.dumps(document))
    capsys.readouterr()
    main(["check", "--dataset", str(path)])
    return capsys.readouterr().out


def test_a_sound_dataset_brings_no_remark(given, capsys):
    assert "warning" not in said_of(given, capsys, lambda _: None)


@pytest.mark.parametrize(
    "text, words",
    [
        (None, "there is no such robot description"),
        ("<robot name='a'><link name='b'></robot>", "urdfdom refuses the description"),
    ],
)
def test_a_description_that_calibrate_could_not_write_is_told(given, capsys, text, words):
    urdf = given.with_name("rig.urdf")
    if text:
        urdf.write_text(text)
    said = said_of(
        given, capsys, lambda d: d["calibration_config"].update(description_file=str(urdf))
    )
    (warning,) = [line for line in said.splitlines() if line.startswith("warning:")]
    assert "optimized.urdf.xacro will not be written" in warning and words in warning


def test_data_files_that_are_all_absent_are_a_problem_for_each_sensor(given, capsys):
    def unplaced(document):
        for sensor in ("rgb_1", "rgb_2"):  # whose labels need no files
            del document["sensors"][sensor]
            for collection in document["collections"].values():
                for part in ("data", "labels"):
                    collection[part].pop(sensor, None)
        for collection in document["collections"].values():
            for data in collection["data"].values():
                data["data_file"] = "gone.pcd"

    said = said_of(given, capsys, unplaced)
    assert "the data files of sensor 'lidar_1' are absent (5 collections); put them beside" in said
    assert "verdict: WRONG" in said


def test_data_that_stand_in_the_json_are_not_called_absent_files(given, capsys):
    def inline(document):
        for collection in document["collections"].values():
            entry = collection["data"]["lidar_1"]
            del entry["data_file"]
            entry["data"] = "AAAA"

    said = said_of(given, capsys, inline)
    assert "the data of sensor 'lidar_1' stand in the JSON itself (as 'data')" in said
    assert "'data_file', or calibrate without it: -ssf '!lidar_1'" in said
    assert "are absent" not in said
    words = ["--dataset", str(given.with_name("changed.json")), "--output", str(given.parent / "o")]
    assert main(["calibrate", *words]) == 2
    assert "stand in the JSON itself" in capsys.readouterr().err


def test_what_is_good_with_a_warning_does_not_look_as_if_nothing_were_wrong(given, capsys):
    def elsewhere(document):
        document["calibration_config"]["description_file"] = "package://gone/rig.urdf.xacro"

    said = said_of(given, capsys, elsewhere)
    assert "verdict: GOOD. Ready to calibrate" in said and "will not be written" in said
    assert "but read what is said above (1 warning)" in said and "nothing looks wrong" not in said


def test_what_is_weak_is_not_called_ready(given, capsys):
    def few(document):
        document["collections"] = dict(list(document["collections"].items())[:3])

    said = said_of(given, capsys, few)
    assert "verdict: WEAK" in said and "ready to calibrate" not in said.lower()


def test_labels_of_three_points_are_told(given, capsys):
    def cut(document):
        for collection in document["collections"].values():
            (labels,) = collection["labels"].values()
            labels["lidar_1"].update(idxs=labels["lidar_1"]["idxs"][:3], idxs_limit_points=[])

    said = said_of(given, capsys, cut)
    assert "only 3 points are labeled" in said
    assert "nothing looks wrong" not in said
