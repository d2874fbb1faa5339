"""What the launch files ask of the master."""

import subprocess
from pathlib import Path

import pytest
import yaml

from atom_calibration.nodes.collecting import collect_data

LAUNCH = Path(__file__).resolve().parents[1] / "launch"
EXAMPLE = Path(__file__).resolve().parents[2] / "atom_examples" / "collab_cell" / "launch"
NO_RVIZ = "rviz:=false"


def parameters(name, *arguments):
    """Return what roslaunch would set."""
    command = ["roslaunch", "--dump-params", str(LAUNCH / name), *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return yaml.safe_load(result.stdout)


def nodes(path, *arguments):
    """Return the names of what roslaunch would start."""
    command = ["roslaunch", "--nodes", str(path), *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return set(result.stdout.split())


def words_of(node, name, *arguments):
    """Return the words with which roslaunch would start a node."""
    command = ["roslaunch", "--args", node, str(LAUNCH / name), *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return result.stdout.split()


@pytest.mark.parametrize("node", ["calibrate", "dataset_playback"])
def test_a_packages_launch_file_without_a_dataset_opens_rviz_alone(node):
    path = EXAMPLE / f"{node}.launch"
    assert nodes(path) == {"/rviz"}
    assert nodes(path, "dataset:=a.json") == {"/rviz", f"/{node}"}
    assert nodes(path, NO_RVIZ) == {f"/{node}"}, "which says that it needs a dataset"


def test_collecting_takes_atoms_words_as_well():
    atoms = ["config_file:=a", "bag_file:=b", "bag_start:=7", "ow:=true", "output_folder:=c"]
    words = words_of("/collect_data", "collect_data.launch", *atoms)
    assert words[words.index("--config") + 1] == "a"
    assert {"--overwrite", "--all_messages"} <= set(words), "as with overwrite, and a recording"
    assert {"--start=7", "--bag=b"} <= set(words_of("/play_bag", "collect_data.launch", *atoms))


@pytest.mark.parametrize(
    ("name", "arguments", "switches"),
    [
        ("calibrate.launch", ["dataset:=a"], ["overwrite", "stay", "rviz"]),
        (
            "calibrate_from_bag.launch",
            ["config:=a", "bag:=b", "output:=c"],
            ["overwrite", "report", "rviz"],
        ),
        (
            "collect_data.launch",
            ["config:=a", "output_folder:=b"],
            ["overwrite", "ow", "automatic", "pictures", "all_messages", "rviz"],
        ),
        ("dataset_playback.launch", ["dataset:=a"], ["overwrite", "rviz"]),
        ("transform_corrector.launch", ["json:=a"], ["overwrite", "two_dimensional", "rviz"]),
    ],
)
def test_what_is_neither_true_nor_false_is_refused_and_not_taken_for_yes(name, arguments, switches):
    loader = pytest.importorskip("roslaunch.xmlloader").XmlLoader()
    config = pytest.importorskip("roslaunch.config").ROSLaunchConfig

    def loaded(*more):
        argv = [*arguments, *more]
        loader.load(str(LAUNCH / name), config(), argv=argv, verbose=False)

    for switch in switches:
        for word in ("true", "false", "True", "0"):
            loaded(f"{switch}:={word}")
        with pytest.raises(ValueError, match="no is not a 'bool' type"):
            loaded(f"{switch}:=no")


@pytest.mark.parametrize("switch", ["paused", "loop", "optimized"])
def test_a_packages_recording_is_not_paused_by_a_word_that_means_no(switch):
    loader = pytest.importorskip("roslaunch.xmlloader").XmlLoader()
    config = pytest.importorskip("roslaunch.config").ROSLaunchConfig()
    with pytest.raises(ValueError, match="no is not a 'bool' type"):
        argv = ["bag_file:=b", f"{switch}:=no"]
        loader.load(str(EXAMPLE / "playbag.launch"), config, argv=argv, verbose=False)


def test_collecting_without_a_configuration_says_so(capsys):
    with pytest.raises(SystemExit) as end:
        collect_data.parser().parse_args(["--config", "", "--output", "a"])
    assert end.value.code == 2
    assert "no configuration; say config:=FILE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("path", "arguments"),
    [
        (LAUNCH / "collect_data.launch", ["config:=a", "output_folder:=b", "bag:=c"]),
        (LAUNCH / "transform_corrector.launch", ["json:=a.json"]),
        (EXAMPLE / "collect_data.launch", ["output_folder:=b"]),
        (EXAMPLE / "set_initial_estimate.launch", []),
    ],
)
def test_nodes_have_the_names_that_documents_say_in_whichever_namespace(
    path, arguments, monkeypatch
):
    before = nodes(path, *arguments)
    monkeypatch.setenv("ROS_NAMESPACE", "robot")
    assert nodes(path, *arguments) == before


@pytest.mark.parametrize(
    ("path", "arguments"),
    [
        (LAUNCH / "collect_data.launch", ["config:=a", "output_folder:=b"]),
        (LAUNCH / "dataset_playback.launch", []),
        (LAUNCH / "calibrate.launch", []),
        (
            LAUNCH / "calibrate_from_bag.launch",
            ["config:=a", "bag:=b", "output:=c", "world:=w", "rviz:=1"],
        ),
        (EXAMPLE / "playbag.launch", ["bag_file:=b"]),
    ],
)
def test_a_layout_of_the_users_is_looked_for_where_the_user_stands(
    path, arguments, tmp_path, monkeypatch
):
    monkeypatch.setenv("PWD", str(tmp_path))
    monkeypatch.setenv("HOME", "/home/me")
    for given, opened in (
        ("my.rviz", tmp_path / "my.rviz"),
        ("~/my.rviz", "/home/me/my.rviz"),
        ("/opt/my~/a.rviz", "/opt/my~/a.rviz"),
    ):
        words = words_of("/rviz", path, *arguments, f"rviz_file:={given}")
        assert words[words.index("-d") + 1] == str(opened)


def test_without_an_output_the_program_is_told_none():
    assert "--output" not in words_of("/calibrate", "calibrate.launch", "dataset:=a.json")
    words = words_of("/calibrate", "calibrate.launch", "dataset:=a.json", "output:=b")
    assert words[words.index("--output") + 1] == "b"


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("dataset_playback.launch", ["dataset:=a.json"]),
        ("transform_corrector.launch", ["json:=a.json"]),
        ("calibrate.launch", ["dataset:=a.json", "output:=b"]),
    ],
)
def test_what_plays_nothing_needs_no_clock_that_an_earlier_launch_left_behind(name, arguments):
    assert parameters(name, *arguments, NO_RVIZ)["/use_sim_time"] is False


def test_beside_a_running_system_the_clock_is_left_alone():
    arguments = ["dataset:=a.json", "output:=b", "tf:=calibrated", NO_RVIZ]
    assert "/use_sim_time" not in parameters("calibrate.launch", *arguments)
