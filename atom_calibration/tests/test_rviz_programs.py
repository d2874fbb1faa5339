"""Programs that become RViz: which files they read, which frame RViz keeps still."""

import sys
from dataclasses import replace

import pytest

from atom_calibration.nodes.collecting import collect_data_rviz
from atom_calibration.nodes.correcting import dataset_playback_rviz
from atom_calibration.runtime.rviz_window import written_layout
from atom_core.io.config_yaml import write_config
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

PROGRAMS = {
    "--config config.yml": collect_data_rviz,
    "--dataset data/dataset.json": dataset_playback_rviz,
}


@pytest.fixture(params=PROGRAMS)
def rviz(request, tmp_path, monkeypatch):
    """Run a program by roslaunch, which stands elsewhere than its user; return RViz's arguments."""
    program, of_user = PROGRAMS[request.param], tmp_path / "user"
    dataset = scenes.two_cameras().dataset
    write_dataset_folder(dataset, of_user / "data", name="two cameras")
    write_config(of_user / "config.yml", replace(dataset.config, world_link="base_link"))
    monkeypatch.setenv("PWD", str(of_user))
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros_home"))
    monkeypatch.chdir(tmp_path)
    became = []
    monkeypatch.setattr(program, "become_rviz", lambda *words: became.append(words) or 0)

    def run(*words):
        theirs = ["__name:=rviz", f"__log:={tmp_path}/rviz.log"]
        monkeypatch.setattr(sys, "argv", ["node", *request.param.split(), *words, *theirs])
        program.main()
        layout, rest = became[0]
        assert list(rest[-2:]) == theirs
        return layout, list(rest[:-2])

    return run


def test_relative_paths_are_those_of_the_user_whom_roslaunch_serves(rviz):
    layout, words = rviz()
    assert layout.is_file() and words == []


def test_a_layout_that_is_there_has_the_frame_that_the_file_tells(rviz):
    layout, words = rviz("--layout", "/opt/calibrate.rviz")
    assert str(layout) == "/opt/calibrate.rviz"
    assert words in (["-f", "base_link"], ["-f", scenes.two_cameras().dataset.world])


def test_a_layout_that_was_saved_from_rviz_stays_until_another_one_is_made(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    path = written_layout("collect_data", "Panels: []")
    assert written_layout("collect_data", "Panels: []") == path and not capsys.readouterr().err
    path.write_text("Panels: [mine]")
    assert written_layout("collect_data", "Panels: []").read_text() == "Panels: [mine]"
    assert f"{path}; remove that file" in capsys.readouterr().err
    other = written_layout("collect_data", "Panels: [of another rig]")
    assert other != path and other.read_text() == "Panels: [of another rig]"
