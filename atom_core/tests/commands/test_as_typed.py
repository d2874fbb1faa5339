"""Refusals name options as the user types them: behind a command, or to roslaunch."""

import sys

import pytest

from atom_core.cli import as_typed, guarded
from atom_core.errors import OutputError

SENTENCE = "results: not empty; add --overwrite, or another folder with --output"
TO_ROSLAUNCH = "results: not empty; add overwrite:=true, or another folder with output:=..."


@pytest.mark.parametrize(
    ("words", "sentence"),
    [(["calibrate"], SENTENCE), (["calibrate", "__name:=c", "__log:=/tmp/c.log"], TO_ROSLAUNCH)],
)
def test_it_is_the_callers_language(words, sentence, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", words)
    assert as_typed(SENTENCE) == sentence

    def refuse():
        raise OutputError(SENTENCE)

    assert guarded("calibrate", refuse) == 2
    assert capsys.readouterr().err == f"calibrate: {sentence}\n"


def test_options_that_no_launch_file_has_stay(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["calibrate", "__log:=/tmp/c.log"])
    assert as_typed("write --weights sigma; --dataset_kind stays") == (
        "write --weights sigma; --dataset_kind stays"
    )
