"""The tutorial without ROS: its commands run in order, and print what the page shows."""

import re
import sys
from pathlib import Path

import pytest

pytest.importorskip("atom_core._core", reason="the compiled module is not built")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))

from make_tutorial_outputs import PAGE, excerpt, excerpts_of, outputs, with_outputs  # noqa: E402

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
PART = 0.05  # by which a figure may differ on another machine


def test_lines_are_sought_one_after_the_other():
    text = "a 1\nb 2\na 3, solved in 0.12 s\n"
    assert excerpt(text, ("b", "...", "a")) == ["b 2", "...", "a 3"]
    with pytest.raises(ValueError, match="'c'"):
        excerpt(text, ("c",))
    with pytest.raises(ValueError, match="'a'"):
        excerpt(text, ("a", "a", "a"))


def same(shown, printed):
    """Tell whether lines have the same words, and numbers that are as good as the same."""
    if NUMBER.sub("#", " ".join(shown.split())) != NUMBER.sub("#", " ".join(printed.split())):
        return "-----" in shown and "-----" in printed  # a column may be wider
    return all(alike(a, b) for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed)))


def alike(one, other):
    last_digit = 10.0 ** -len(one.partition(".")[2])
    return abs(float(one) - float(other)) <= max(PART * abs(float(one)), 2.5 * last_digit)


def test_numbers_that_are_wrong_and_other_words_are_seen():
    assert same("rms 1.00 px", "rms  1.02 px") and same("5 iterations", "6 iterations")
    assert not same("63732 residuals", "75922 residuals")
    assert not same("rms 1.00 px", "mean 1.00 px")


@pytest.mark.slow
def test_the_commands_run_in_order_and_print_what_the_page_shows(tmp_path):
    page = PAGE.read_text(encoding="utf-8")
    every = list(outputs(page, tmp_path))
    assert [output.code for output in every] == [0] * len(every) and len(every) == 6
    made = with_outputs(page, excerpts_of(every)).splitlines()
    shown = page.splitlines()
    remedy = "run `python3 docs/make_tutorial_outputs.py`"
    assert len(made) == len(shown), remedy
    assert [pair for pair in zip(shown, made) if not same(*pair)] == [], remedy
