"""Files of two runs never stand together, whenever the second one is killed."""

import itertools
import json
import multiprocessing
import os
import time

import numpy as np
import pytest

from atom_core.errors import OutputError
from atom_core.io.atomic import write_text_atomically
from atom_core.io.together import LIST_FILE, finish_interrupted, written_together

NAMES = ["a.json", "b.csv", "c.yml", "sometimes.csv"]
FIRST = dict.fromkeys(NAMES, "first")
SECOND = dict.fromkeys(NAMES[:3], "second")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "others.txt").write_text("not ours")
    write_run(tmp_path, FIRST)
    return tmp_path


def write_run(folder, texts):
    with written_together(folder, NAMES):
        for name, text in texts.items():
            write_text_atomically(folder / name, text)


def seen(folder):
    """Return what a user sees there, but for the file that is not ours."""
    texts = {p.name: p.read_text() for p in folder.iterdir() if not p.name.startswith(".")}
    assert texts.pop("others.txt") == "not ours"
    return texts


def test_what_the_second_run_does_not_write_is_gone(folder):
    write_run(folder, SECOND)
    assert seen(folder) == SECOND
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("call", ["os.replace", "os.fsync", "pathlib.Path.unlink"])
def test_whenever_it_is_killed_one_run_is_there_and_the_next_look_completes_it(
    folder, monkeypatch, call
):
    original = getattr(os, call[3:]) if call.startswith("os.") else type(folder).unlink
    outcomes = set()
    for number in itertools.count():
        write_run(folder, FIRST)
        calls = itertools.count()

        def killed(*args, calls=calls, number=number, **options):
            if next(calls) >= number:
                raise Killed
            return original(*args, **options)

        with monkeypatch.context() as patch:
            patch.setattr(call, killed)
            try:
                write_run(folder, SECOND)
                break
            except Killed:
                pass
        assert len(set(seen(folder).values())) <= 1  # never of both
        finish_interrupted(folder)
        assert seen(folder) in (FIRST, SECOND)
        outcomes.add(seen(folder)["a.json"])
    assert seen(folder) == SECOND and number >= 3
    assert "first" in outcomes or call == "pathlib.Path.unlink"
    write_run(folder, FIRST)
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_process_that_is_killed_at_any_moment_leaves_one_run(folder):
    rng, forking = np.random.default_rng(0), multiprocessing.get_context("fork")
    for _ in range(10):
        process = forking.Process(target=write_for_ever, args=(folder,))
        process.start()
        time.sleep(rng.uniform(0.02, 0.06))
        process.kill()
        process.join()
        assert len(set(seen(folder).values())) <= 1
        finish_interrupted(folder)
        assert seen(folder) in (FIRST, SECOND)


def write_for_ever(folder):
    while True:
        write_run(folder, SECOND)
        write_run(folder, FIRST)


class Killed(BaseException):
    """No handler of ours catches it."""


def test_a_full_disk_leaves_the_run_of_before(folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", full)
        with pytest.raises(OutputError, match="no space left"):
            write_run(folder, SECOND)
    assert seen(folder) == FIRST
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_files_of_other_folders_are_written_at_once(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other") / "x.txt"
    with written_together(folder, NAMES):
        write_text_atomically(other, "now")
        assert other.read_text() == "now"


@pytest.mark.parametrize("inside", [True, False])
def test_a_link_that_is_written_through_stays_one(folder, tmp_path_factory, inside):
    real = (folder if inside else tmp_path_factory.mktemp("other")) / "real.json"
    real.write_text("first")
    for link, target in (("a.json", "sometimes.csv"), ("sometimes.csv", real)):
        (folder / link).unlink()
        (folder / link).symlink_to(target)
    write_run(folder, SECOND)
    assert real.read_text() == "second"
    links = {"a.json", "sometimes.csv"}
    assert {path.name for path in folder.iterdir() if path.is_symlink()} == links
    assert {seen(folder)[name] for name in (*NAMES, *links)} == {"second"}


def test_a_link_that_no_longer_is_a_result_goes_and_what_it_names_stays(folder, tmp_path_factory):
    real = tmp_path_factory.mktemp("other") / "real.csv"
    (folder / "sometimes.csv").rename(real)
    (folder / "sometimes.csv").symlink_to(real)
    write_run(folder, SECOND)
    assert seen(folder) == SECOND and real.read_text() == "first"


def test_a_list_of_another_making_reaches_no_other_file(folder):
    outside = folder.parent / "precious.txt"
    outside.write_text("precious")
    document = {"remove": ["../precious.txt", str(outside)], "rename": {"others.txt": "a.json"}}
    (folder / LIST_FILE).write_text(json.dumps(document))
    finish_interrupted(folder)
    assert outside.read_text() == "precious" and seen(folder) == FIRST
    for text in ("[]", "{", '{"rename": 5, "remove": []}'):
        (folder / LIST_FILE).write_text(text)
        finish_interrupted(folder)
        assert seen(folder) == FIRST
