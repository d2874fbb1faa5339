"""Folders whose names are no UTF-8, and terminals that cannot show every sign."""

import os
import subprocess
import sys

import pytest

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

NOT_UTF8 = os.fsdecode(b"da\xffta")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("names")
    scene = scenes.random_scene(2, rgb=1, depth=0, lidar3d=1, collections=4)
    for name in (NOT_UTF8, "größe"):
        write_dataset_folder(scene.dataset, folder / name / "data", name="scene")
    return folder


def run(encoding, *words):
    """Run a command on a terminal of an encoding; return its exit code and what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "atom_core", *map(str, words)],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
def test_every_step_takes_and_prints_a_folder_whose_name_is_no_utf8(folder):
    dataset, results = folder / NOT_UTF8 / "data" / "dataset.json", folder / NOT_UTF8 / "results"
    steps = [
        ("calibrate", "--dataset", dataset, "--output", results, "--no_report"),
        ("evaluate", "--train", results / "atom_calibration.json", "--test", dataset)
        + ("--output", results / "evaluation", "--no_report"),
        ("report", "--calibration", results, "--output", results),
    ]
    for words in steps:
        code, said = run("utf-8:strict", *words)
        assert code in (0, 1) and b"Traceback" not in said, said.decode(errors="replace")
        assert b"da\xffta" in said, words
    assert (results / "report.html").stat().st_size > 100_000


@pytest.mark.sampled(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "encoding", "shown"),
    [
        (NOT_UTF8, "ascii:strict", b"da\xffta"),
        ("größe", "ascii:strict", b"gr??e"),
        ("größe", "latin-1:strict", b"gr\xf6\xdfe"),
    ],
    ids=["bytes", "ascii", "latin1"],
)
def test_a_terminal_need_not_know_every_sign(folder, name, encoding, shown):
    code, said = run(encoding, "check", "--dataset", folder / name / "data" / "dataset.json")
    assert code in (0, 1) and shown in said and b"Traceback" not in said
    code, said = run(encoding, "check", "--dataset", folder / name / "absent.json")
    assert code == 2 and shown in said and len(said.splitlines()) == 1
