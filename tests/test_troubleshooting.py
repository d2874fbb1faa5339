"""Typical mistakes end with one sentence that helps; docs/troubleshooting.md shows them."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("rosbag", reason="ROS is not installed")
pytest.importorskip("atom_core._core", reason="the compiled module is not built")
ROOT = Path(__file__).resolve().parents[1]
for folder in ("docs", "tests"):
    sys.path.insert(0, str(ROOT / folder))

from make_troubleshooting import PAGE, page  # noqa: E402
from mistakes import EVERY, SmallFiles  # noqa: E402

CASES = [
    pytest.param(title, number, id=mistake.what)
    for title, (_, mistakes) in EVERY.items()
    for number, mistake in enumerate(mistakes)
]


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Return a function: section and number of a mistake -> what is said to it; made once each."""
    files = SmallFiles(tmp_path_factory.mktemp("mistakes"))
    made = {}

    def answer(title, number):
        if (title, number) not in made:
            program, mistakes = EVERY[title]
            made[title, number] = files.answer(program, mistakes[number])
        return made[title, number]

    return answer


def test_there_are_thirty_and_more():
    assert len(CASES) >= 30


@pytest.mark.parametrize(("title", "number"), CASES)
def test_one_sentence_with_the_exit_code_that_is_due(title, number, answers):
    code, sentence = answers(title, number)
    assert code == EVERY[title][1][number].code
    assert sentence and "\n" not in sentence and "Traceback" not in sentence
    assert len(sentence) < 400  # a newcomer reads it


def test_the_page_shows_what_is_said(answers):
    found = {t: [answers(t, n) for n in range(len(those))] for t, (_, those) in EVERY.items()}
    shown = PAGE.read_text(encoding="utf-8")
    assert shown == page(found), "run `python3 docs/make_troubleshooting.py`"
