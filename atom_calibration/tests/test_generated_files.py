"""Files that are made anew without losing what the user changed in them."""

import hashlib
import json
from pathlib import Path

import pytest

from atom_calibration.configure import files as generated
from atom_calibration.configure.files import GeneratedFiles


def test_files_of_a_run_that_was_killed_are_no_edits_of_the_user(tmp_path, monkeypatch):
    def files():
        return GeneratedFiles(tmp_path, tmp_path / "generated.json")

    def killed(path, content, write=generated.write_bytes_atomically):
        write(path, content)
        if path.name == "b":
            raise KeyboardInterrupt

    files().write({"a": b"1", "b": b"1", "c": b"1"}, overwrite=False)
    (tmp_path / "c").write_bytes(b"mine")
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(generated, "write_bytes_atomically", killed)
        files().write({"a": b"2", "b": b"2", "c": b"2"}, overwrite=False)
    outcome = files().write({"a": b"3", "b": b"3", "c": b"3"}, overwrite=False)
    assert (outcome.written, outcome.kept) == (["a", "b"], ["c"])


def test_what_another_program_made_is_kept_and_is_no_edit(tmp_path):
    """As in a package that ATOM has configured."""
    (tmp_path / "a").write_bytes(b"of ATOM")
    files = GeneratedFiles(tmp_path, tmp_path / "generated.json")
    outcome = files.write({"a": b"1", "b": b"1"}, overwrite=False)
    assert (outcome.kept, outcome.foreign, outcome.written) == (["a"], ["a"], ["b"])
    assert files.write({"a": b"1"}, overwrite=True).replaced == ["a"]
    (tmp_path / "a").write_bytes(b"mine")
    outcome = files.write({"a": b"2"}, overwrite=False)
    assert (outcome.kept, outcome.foreign) == (["a"], [])


def test_the_checksums_of_the_simulated_cell_are_those_of_its_files():
    folder = Path(__file__).resolve().parents[2] / "atom_examples" / "collab_cell"
    sums = json.loads((folder / "config" / "generated.json").read_text("utf-8"))["sha256"]
    of_files = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in sums}
    assert of_files == sums
