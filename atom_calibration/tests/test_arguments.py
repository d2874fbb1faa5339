"""The command line of a node, and where its relative paths are."""

import os
import sys

import pytest

from atom_calibration.runtime import running


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """Stand where roslaunch starts nodes; return that folder and the user's."""
    of_ros, of_user = tmp_path / "ros", tmp_path / "user"
    for folder in (of_ros, of_user):
        folder.mkdir()
    monkeypatch.chdir(of_ros)
    monkeypatch.setenv("PWD", str(of_user))
    return of_ros, of_user


def test_with_roslaunch_relative_paths_are_where_the_user_stands(folders, monkeypatch):
    words = ["node", "--dataset", "data/dataset.json", "__name:=node", "__log:=/tmp/node.log"]
    monkeypatch.setattr(sys, "argv", words)
    assert running.arguments() == ["--dataset", "data/dataset.json"]
    assert os.path.samefile(os.getcwd(), folders[1])


def test_with_roslaunch_the_home_folder_is_that_which_the_shell_leaves(folders, monkeypatch):
    monkeypatch.setenv("HOME", "/home/me")
    words = ["node", "--dataset", "~/a.json", "--output=~/b", "~c", "a~/b", "__log:=/tmp/node.log"]
    monkeypatch.setattr(sys, "argv", words)
    expected = ["--dataset", "/home/me/a.json", "--output=/home/me/b", "~c", "a~/b"]
    assert running.arguments() == expected


def test_without_it_nobody_moves(folders, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["node", "--dataset", "data/dataset.json"])
    assert running.arguments() == ["--dataset", "data/dataset.json"]
    assert os.path.samefile(os.getcwd(), folders[0])


def test_where_the_users_folder_is_gone_it_stays(folders, monkeypatch):
    folders[1].rmdir()
    monkeypatch.setattr(sys, "argv", ["node", "__log:=/tmp/node.log"])
    assert running.arguments() == []
    assert os.path.samefile(os.getcwd(), folders[0])
