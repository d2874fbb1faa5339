"""A file is complete or as it was before; every failure is one line with a remedy."""

import errno
import json
import os
import resource
import subprocess
import sys

import numpy as np
import pytest

from atom_core.errors import OutputError
from atom_core.io import atomic
from atom_core.io.atomic import (
    prepare_output_folder,
    write_bytes_atomically,
    write_json_atomically,
    write_text_atomically,
)


def names_in(folder):
    return sorted(entry.name for entry in folder.iterdir())


def one_line(error):
    assert "\n" not in str(error.value)
    return str(error.value)


def test_bytes_come_back_and_nothing_else_is_left(tmp_path):
    rng = np.random.default_rng(1)
    for size in (0, 1, 100_000):
        data = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        write_bytes_atomically(tmp_path / "a.bin", data)
        assert (tmp_path / "a.bin").read_bytes() == data
    assert names_in(tmp_path) == ["a.bin"]


def test_text_is_utf8(tmp_path):
    write_text_atomically(str(tmp_path / "ç.txt"), "câmara µm")
    assert (tmp_path / "ç.txt").read_text(encoding="utf-8") == "câmara µm"


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EDQUOT, errno.EIO])
@pytest.mark.parametrize("call", ["fsync", "replace", "open"])
def test_failure_keeps_the_old_file_and_leaves_nothing(tmp_path, monkeypatch, code, call):
    path = tmp_path / "result.json"
    path.write_text("old")

    def fail(*_args, **_kwargs):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(atomic.os, call, fail)
    with pytest.raises(OutputError) as error:
        write_text_atomically(path, "new")
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert names_in(tmp_path) == ["result.json"]
    assert str(path) in one_line(error) and ";" in one_line(error)


def test_interrupt_leaves_nothing(tmp_path, monkeypatch):
    def interrupt(_descriptor):
        raise KeyboardInterrupt

    monkeypatch.setattr(atomic.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_text_atomically(tmp_path / "a", "new")
    monkeypatch.undo()
    assert names_in(tmp_path) == []


def test_a_real_write_error_keeps_the_old_file(tmp_path):
    """The kernel, not a mock, refuses the second half of the file."""
    path = tmp_path / "result.bin"
    path.write_bytes(b"old")
    program = (
        "import sys; from atom_core.io.atomic import write_bytes_atomically as w;"
        "from atom_core.errors import OutputError\n"
        f"try: w({str(path)!r}, bytes(200_000))\n"
        "except OutputError as e: print(e); sys.exit(7)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)),
    )
    assert done.returncode == 7
    assert len(done.stdout.splitlines()) == 1 and "ulimit" in done.stdout
    assert path.read_bytes() == b"old"
    assert names_in(tmp_path) == ["result.bin"]


def test_absent_folder_and_folder_as_target_are_named(tmp_path):
    with pytest.raises(OutputError, match="create the folder first"):
        write_text_atomically(tmp_path / "absent" / "a", "x")
    with pytest.raises(OutputError, match="a folder has this name"):
        write_text_atomically(tmp_path, "x")


def test_permissions_and_links_survive(tmp_path):
    path, link = tmp_path / "a", tmp_path / "link"
    path.write_text("old")
    path.chmod(0o640)
    link.symlink_to(path)
    write_text_atomically(link, "new")
    assert link.is_symlink() and path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_new_file_obeys_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        write_text_atomically(tmp_path / "a", "x")
    finally:
        os.umask(old)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_json_round_trip_keeps_every_digit(tmp_path):
    values = np.random.default_rng(2).normal(size=50) * 10.0 ** np.arange(-25, 25)
    document = {"b": values, "a": {"n": np.int64(3), "x": np.float32(0.5), "t": "é"}, "z": None}
    write_json_atomically(tmp_path / "a.json", document)
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    assert json.loads(text)["b"] == values.tolist()
    assert json.loads(text)["a"] == {"n": 3, "x": 0.5, "t": "é"}
    assert text.index('"a"') < text.index('"b"') and text.endswith("}\n")


def test_json_keeps_the_order_when_asked(tmp_path):
    write_json_atomically(tmp_path / "a.json", {"b": 1, "a": 2}, sort_keys=False)
    assert (tmp_path / "a.json").read_text() == '{\n  "b": 1,\n  "a": 2\n}\n'


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), np.array([1.0, -np.inf])])
def test_json_names_the_number_that_is_not_finite(tmp_path, bad):
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(OutputError, match=r"rows\.1\.mean"):
        write_json_atomically(path, {"rows": [{"mean": 1.0}, {"mean": bad}]})
    assert path.read_text() == "old"


def test_json_refuses_what_it_cannot_hold_before_writing(tmp_path):
    with pytest.raises(TypeError, match="set"):
        write_json_atomically(tmp_path / "a.json", {"a": {1, 2}})
    assert names_in(tmp_path) == []


def test_output_folder_is_made_with_its_parents(tmp_path):
    assert prepare_output_folder(tmp_path / "a" / "b", overwrite=False).is_dir()
    prepare_output_folder(str(tmp_path / "a" / "b"), overwrite=False)  # still empty


def test_full_output_folder_needs_overwrite(tmp_path):
    (tmp_path / "a").write_text("old")
    with pytest.raises(OutputError, match="--overwrite"):
        prepare_output_folder(tmp_path, overwrite=False)
    prepare_output_folder(tmp_path, overwrite=True)
    assert (tmp_path / "a").read_text() == "old"


@pytest.mark.parametrize("name", ["file", "file/below"])
def test_file_in_the_way_of_the_output_folder(tmp_path, name):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="a file is in the way"):
        prepare_output_folder(tmp_path / name, overwrite=True)


def test_folder_that_cannot_be_made_is_one_line(tmp_path, monkeypatch):
    def refuse(*_args, **_kwargs):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(atomic.Path, "mkdir", refuse)
    with pytest.raises(OutputError, match="writable") as error:
        prepare_output_folder(tmp_path / "a", overwrite=False)
    one_line(error)
