"""docs/reliability.md says what the tests show: every failure mode has a test, which is there."""

import ast
import sys
from functools import lru_cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "docs"), str(ROOT / "tests")]

from failure_modes import FAILURE_MODES  # noqa: E402
from make_reliability import PAGE, with_tables  # noqa: E402


@lru_cache(maxsize=None)
def functions_of(file):
    module = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(module) if isinstance(node, ast.FunctionDef)}


def test_every_failure_mode_stands_there_once():
    assert [row.number for row in FAILURE_MODES] == list(range(1, 31))


@pytest.mark.parametrize("row", FAILURE_MODES, ids=lambda row: str(row.number))
def test_the_tests_of_a_failure_mode_are_there(row):
    assert row.tests
    for test in row.tests:
        file, name = test.split("::")
        assert name in functions_of(file), test


def test_the_page_is_up_to_date():
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_tables(page), "run `python3 docs/make_reliability.py`"
