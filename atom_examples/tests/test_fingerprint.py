"""A bag is reused only if it would be the same again, byte by byte."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from atom_examples.cell_simulator import fingerprint
from atom_examples.cell_simulator import main as program
from atom_examples.cell_simulator.recorder import Recording, recording_files

RECORDING = Recording(collections=1, stop_s=0.3)


@pytest.fixture
def bag(tmp_path):
    """Return the path of a bag with its companions and its fingerprint; not a real recording."""
    path = tmp_path / "a.bag"
    for file in recording_files(path):
        file.write_bytes(file.name.encode() * 1000)
    fingerprint.write_fingerprint(path, "inputs")
    return path


def test_what_was_written_is_current(bag):
    assert fingerprint.is_current(bag, "inputs")


def test_other_inputs_are_not_current(bag):
    assert not fingerprint.is_current(bag, "others")


@pytest.mark.parametrize("number", range(3))
def test_a_file_that_was_cut_off_changed_or_removed_is_not_current(bag, number):
    file = recording_files(bag)[number]
    whole = file.read_bytes()
    file.write_bytes(whole[:-1])
    assert not fingerprint.is_current(bag, "inputs")
    file.write_bytes(whole[:500] + b"#" + whole[501:])
    assert not fingerprint.is_current(bag, "inputs")
    file.unlink()
    assert not fingerprint.is_current(bag, "inputs")
    file.write_bytes(whole)
    assert fingerprint.is_current(bag, "inputs")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"version": "1.0", "inputs": "inputs"}', "\xff"])
def test_a_damaged_fingerprint_is_not_current(bag, text):
    fingerprint.fingerprint_path(bag).write_bytes(text.encode("latin-1"))
    assert not fingerprint.is_current(bag, "inputs")


def test_inputs_are_those_of_the_same_call_alone(world, monkeypatch):
    inputs = fingerprint.inputs_of(world, RECORDING)
    assert fingerprint.inputs_of(world, RECORDING) == inputs
    for change in (
        {"collections": 2},
        {"scenario": "test"},
        {"compressed": True},
        {"noise": False},
        {"initial_estimate": "exact"},
        {"depth_encoding": "32FC1"},
        {"cloud_hz": 2.0},
    ):
        assert fingerprint.inputs_of(world, replace(RECORDING, **change)) != inputs, change
    monkeypatch.setattr(world, "seed", 1)
    assert fingerprint.inputs_of(world, RECORDING) != inputs


def test_inputs_follow_programs_description_and_versions(world, monkeypatch, tmp_path):
    inputs = fingerprint.inputs_of(world, RECORDING)

    def changed(ending):
        def of_file(path, plain=fingerprint._hash_file):
            return "other" if str(path).endswith(ending) else plain(path)

        monkeypatch.setattr(fingerprint, "_hash_file", of_file)
        other = fingerprint.inputs_of(world, RECORDING)
        monkeypatch.undo()
        return other != inputs

    assert changed("cell_simulator/lidar.py") and changed("synthetic/cell.py")
    assert changed("config/sensors.yaml") and changed("urdf/gantry.xacro")
    assert not changed("solvers/base.py")
    monkeypatch.setattr(fingerprint.cv2, "__version__", "0")
    assert fingerprint.inputs_of(world, RECORDING) != inputs
    monkeypatch.undo()
    edges = world.edges
    moved = {edge: pose.copy() for edge, pose in edges("exact").items()}
    moved[next(iter(moved))][0, 3] += 1e-9
    monkeypatch.setattr(world, "edges", lambda _: moved)
    assert fingerprint.inputs_of(world, RECORDING) != inputs


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return a real recording's path, the modules that it loaded, and those of its fingerprint."""
    bag = tmp_path_factory.mktemp("recorded") / "a.bag"
    code = (
        "import json, sys; from atom_examples.cell_simulator import main, fingerprint;"
        "code = main.main(sys.argv[1:]);"
        "print(json.dumps([code, sorted(sys.modules), sorted(fingerprint.program_files())]))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, "--bag", str(bag), "--collections", "1"],
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
    )
    code, loaded, known = json.loads(result.stdout.splitlines()[-1])
    assert code == 0
    return bag, set(loaded), set(known)


@pytest.mark.slow
def test_a_recording_loads_no_module_that_its_fingerprint_does_not_know(recorded):
    _, loaded, known = recorded
    mine = {name for name in loaded if name.split(".")[0] in ("atom_core", "atom_examples")}
    # The compiled module takes part by the robots that it reads, which are hashed as they are, and
    # the parser of commands by what it reads, which is hashed, too; progress is only told.
    others = {"atom_core", "atom_core.io", "atom_examples", "atom_core._core"}
    others |= {
        f"atom_core.commands{m}" for m in ("", ".option_parser", ".atom_options", ".progress")
    }
    assert mine - others <= known


@pytest.mark.long
@pytest.mark.slow
def test_the_command_keeps_what_would_be_the_same_and_replaces_it_only_when_told(recorded, capsys):
    bag, _, _ = recorded
    arguments = ["--bag", str(bag), "--collections", "1", "--reuse"]
    stamps = {f: f.stat().st_mtime_ns for f in [bag, fingerprint.fingerprint_path(bag)]}
    assert program.main(arguments) == 0
    assert "kept" in capsys.readouterr().out
    assert all(file.stat().st_mtime_ns == stamp for file, stamp in stamps.items())
    folder = bag.parent
    whole = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert {".bag", ".truth.json", ".labels.npz"} <= {"".join(Path(n).suffixes) for n in whole}
    bag.write_bytes(whole[bag.name][: len(whole[bag.name]) // 2])
    assert program.main(arguments) == 2
    assert "is not what would be recorded now" in capsys.readouterr().err
    assert program.main([*arguments, "--overwrite"]) == 0
    # The same seed gives the same files, in another process and planned anew.
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == whole
