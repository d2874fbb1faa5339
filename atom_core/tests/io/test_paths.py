"""Texts of configurations become paths; what cannot be resolved is one line with a remedy."""

from pathlib import Path

import pytest

from atom_core.errors import ConfigError
from atom_core.io.paths import looked_for, resolve_path, unread

FOLDERS = {"rig": "/ws/src/rig", "arm": Path("/ws/src/arm")}


@pytest.mark.parametrize(
    "text, expected",
    [
        ("package://rig/urdf/rig.urdf", "/ws/src/rig/urdf/rig.urdf"),
        ("package://arm", "/ws/src/arm"),
        ("file:///data/a%20b.bag", "/data/a b.bag"),
        ("file://$ATOM_TEST/a.bag", "/bags/a.bag"),
        ("/data/a.bag", "/data/a.bag"),
        ("~/a.bag", "/home/me/a.bag"),
        ("$ATOM_TEST/a.bag", "/bags/a.bag"),
        ("${ATOM_TEST}/a.bag", "/bags/a.bag"),
        ("a/b.bag", "/base/a/b.bag"),
        ("  /data/a.bag ", "/data/a.bag"),
    ],
)
def test_every_form(monkeypatch, text, expected):
    monkeypatch.setenv("ATOM_TEST", "/bags")
    monkeypatch.setenv("HOME", "/home/me")
    assert resolve_path(text, FOLDERS.__getitem__, "/base") == Path(expected)


def test_relative_paths_begin_in_the_working_folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert resolve_path("a.bag").absolute() == tmp_path / "a.bag"


@pytest.mark.parametrize(
    "text, message",
    [
        ("package://gone/a", "package 'gone' is not found .*source its workspace"),
        ("$ATOM_TEST_GONE/a", "variable 'ATOM_TEST_GONE' is not set"),
        ("${ATOM_TEST_GONE}/a", "variable 'ATOM_TEST_GONE' is not set"),
        ("https://host/a", "'https://' is unknown; use package://"),
        (" ", "a path is empty"),
    ],
)
def test_errors_name_the_flaw_and_the_remedy(text, message):
    with pytest.raises(ConfigError, match=message):
        resolve_path(text, FOLDERS.__getitem__)


def test_packages_of_ros_are_found_without_a_resolver():
    pytest.importorskip("rospkg", reason="rospkg is not installed; `make setup` installs it")
    with pytest.raises(ConfigError, match="'no_such_package_of_atom' is not found"):
        resolve_path("package://no_such_package_of_atom/a")


def test_a_relative_path_is_told_with_where_it_was_looked_for(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert looked_for("data/a.json") == f", looked for at {tmp_path}/data/a.json"
    assert looked_for(Path("../a.json")) == f", looked for at {tmp_path.parent}/a.json"
    assert looked_for("/data/a.json") == ""
    with pytest.raises(FileNotFoundError) as absent:
        Path("a.bag").read_bytes()
    assert unread("a.bag", absent.value) == (
        f"no such file or directory, looked for at {tmp_path}/a.bag"
    )
