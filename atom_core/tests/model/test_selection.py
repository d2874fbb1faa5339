"""Selections of names: what they select, and that all else is refused in a sentence."""

import random

import pytest

from atom_core.errors import SelectionError
from atom_core.model.selection import select_names

NAMES = ["rgb_1", "rgb_2", "lidar_1", "12"]


@pytest.mark.parametrize(
    "expressions, selected",
    [
        (["rgb_*"], ["rgb_1", "rgb_2"]),
        (["lidar_1", "rgb_1"], ["rgb_1", "lidar_1"]),
        (["!rgb_1"], ["rgb_2", "lidar_1", "12"]),
        (["lambda s: s.startswith('rgb') and s != 'rgb_2'"], ["rgb_1"]),
        (["lambda s: s.isdigit() and int(s) % 2 == 0"], ["12"]),
        (["lambda s: s in ['rgb_2', 'lidar_1']"], ["rgb_2", "lidar_1"]),
        ([f"lambda s: s in {['rgb_2', *map(str, range(20, 5000))]}"], ["rgb_2"]),
    ],
)
def test_what_is_selected(expressions, selected):
    assert select_names(NAMES, expressions) == selected


@pytest.mark.parametrize(
    "expression, reason",
    [
        ("lambda s: 1 % 0", "fails on 'rgb_1': .*modulo"),
        ("lambda s: 1.5 % 0", "fails on 'rgb_1': .*modulo"),
        ("lambda s: int(s) > 1", "fails on 'rgb_1'"),
        ("lambda s: " + "(" * 5000 + "s" + ")" * 5000, "lambda"),
        ("lambda s: " + "-" * 100_000 + "1", "lambda"),
        ("lambda s: \0", "lambda"),
        ("lambda s: " + "not " * 900 + "s", "lambda"),
        ("lambda s: " + "- " * 9_000 + "1", "lambda"),
        ("lambda s: " + "1 ** " * 9_000 + "1", "lambda"),
        ("lambda s: " * 9_000 + "1", "lambda"),
        ("lambda s: " + "1 if s else " * 9_000 + "1", "lambda"),
        ("lambda s: 9 ** 9 ** 9", "not allowed"),
        ("lambda s: 'a' * 9", "not allowed"),
        ("lambda s: '%999999999d' % 1", "not allowed"),
        ("lambda s: s.format(s)", "not allowed"),
        ("lambda s: s.__class__", "not allowed"),
        ("lambda s: [c for c in s]", "not allowed"),
    ],
)
def test_what_is_refused(expression, reason):
    with pytest.raises(SelectionError, match=reason):
        select_names(NAMES, [expression])


def test_whatever_stands_there_is_selected_or_refused():
    words = "lambda s : s 1 0 'rgb' ( ) [ ] , . int len str range in not and or == < - + % ** * !"
    drawn = random.Random(0)
    selected = 0
    for _ in range(3000):
        text = "lambda s: " + " ".join(drawn.choices(words.split(), k=drawn.randint(1, 7)))
        try:
            selected += bool(select_names(NAMES, [text]))
        except SelectionError as error:
            assert "\n" not in str(error)
    assert selected > 20, "some of them mean something"


@pytest.mark.parametrize("names", [NAMES, []])
@pytest.mark.parametrize("expression", ["lambda s: False", "lambda s: s == 'odom'", "!*"])
def test_a_condition_may_hold_for_nothing_where_nothing_can_be_selected(names, expression):
    if names or expression != "!*":
        assert select_names(names, [expression], may_be_empty=True) == []
    with pytest.raises(SelectionError):
        select_names(names, [expression])


@pytest.mark.parametrize("expression", ["odom", "rgb_3*", "!odom", "!lidar*_9"])
def test_a_name_that_is_none_is_a_slip_even_where_nothing_can_be_selected(expression):
    with pytest.raises(SelectionError, match="there are: rgb_1"):
        select_names(NAMES, [expression], may_be_empty=True)
    with pytest.raises(SelectionError, match="there are: none"):
        select_names([], [expression], may_be_empty=True)
