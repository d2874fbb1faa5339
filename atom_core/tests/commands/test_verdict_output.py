"""Grades in colour, on terminals only."""

import io
import shlex
import sys

import pytest

from atom_core.cli import main
from atom_core.commands.verdict_output import coloured, print_next, print_verdict, shows_colours
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.report.verdict import SensorVerdict, Verdict, verdict_lines
from atom_core.synthetic import scenes

VERDICT = Verdict(
    "wrong",
    "good cameras cannot mend it",
    {"left": SensorVerdict("wrong", "off"), "right_2": SensorVerdict("good", "a good wrong word")},
)


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(autouse=True)
def colours(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_the_grades_alone_are_coloured():
    text = coloured(verdict_lines(VERDICT))
    first, left, right = text.splitlines()
    assert first.startswith("verdict: \033[1;31mWRONG\033[0m. Good cameras")
    assert left.startswith("  left     \033[1;31mwrong\033[0m  off")
    assert right.startswith("  right_2  \033[1;32mgood\033[0m   a good wrong word")
    assert text.count("\033[0m") == 3


def test_a_file_and_who_wants_none_get_plain_text(monkeypatch, capsys):
    print_verdict(VERDICT)
    assert capsys.readouterr().out == verdict_lines(VERDICT) + "\n"
    monkeypatch.setattr(sys, "stdout", Terminal())
    print_verdict(VERDICT)
    assert "\033[1;31mWRONG" in sys.stdout.getvalue()
    monkeypatch.setenv("NO_COLOR", "1")
    assert not shows_colours(Terminal())
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "dumb")
    assert not shows_colours(Terminal())


@pytest.mark.parametrize(
    "program, begin",
    [
        ("/ws/devel/lib/atom_calibration/check", "rosrun atom_calibration"),
        ("/ws/src/atom/atom_core/src/atom_core/__main__.py", "python3 -m atom_core"),
    ],
)
def test_what_comes_next_is_told_as_the_user_types(monkeypatch, capsys, program, begin):
    monkeypatch.setattr(sys, "argv", [program])
    print_next("calibrate", "--dataset", "/my data/dataset.json", "-ssf", "!rgb_1")
    line = f"next: {begin} calibrate --dataset '/my data/dataset.json' -ssf '!rgb_1'"
    assert capsys.readouterr().out == f"\n{line}\n"


def test_check_and_calibrate_end_with_what_comes_next(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = scenes.random_scene(0, collections=6, disturbance=(0.03, 0.03))
    write_dataset_folder(scene.dataset, tmp_path / "data", name="data")
    assert main(["check", "--dataset", "data/dataset.json", "-ssf", "rgb_*"]) == 0
    told = last_line(capsys)
    assert told.startswith("next: ") and f"--dataset {tmp_path}/data/dataset.json" in told
    words = shlex.split(told.split(" calibrate ")[1])
    assert words[2:] == ["-ssf", "rgb_*", "--output", "results"]
    assert main(["calibrate", "--no_report", *words]) == 0
    told = last_line(capsys)
    assert told.startswith("next: ") and f"--train {tmp_path}/results/atom_calib" in told


def last_line(capsys):
    return capsys.readouterr().out.splitlines()[-1]
