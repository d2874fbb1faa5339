"""Grades in colour, on terminals only."""

import io
import sys

import pytest

from atom_core.commands.verdict_output import coloured, print_verdict, shows_colours
from atom_core.report.verdict import SensorVerdict, Verdict, verdict_lines

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
