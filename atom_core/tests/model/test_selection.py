"""Selections of names: what they select, and that all else is refused in a sentence."""

import random
import time

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
        ("lambda s: [9] * 9", "not allowed"),
        ("lambda s: {c: c for c in s}", "not allowed"),
        ("lambda s: f'{s:999999999}'", "not allowed"),
        ("lambda s: [c.__class__ for c in s]", "not allowed"),
        ("lambda s: open(s)", "not allowed"),
        ("lambda s: nobody", "'nobody' is not allowed"),
        ("lambda s: s[0](s)", "not allowed"),
        ("lambda s: s[9]", "fails on 'rgb_1': .*range"),
        ("lambda s: 1 // 0", "fails on 'rgb_1': .*zero"),
        ("lambda s: len(range(9**9))", "not allowed"),
        ("lambda s: s" + "[:]" * 9_000, "lambda"),
        ("lambda s: s" + ".lower()" * 9_000, "lambda"),
        ("lambda s: [" + "1 for c in s " * 9_000 + "]", "lambda"),
    ],
)
def test_what_is_refused(expression, reason):
    with pytest.raises(SelectionError, match=reason):
        select_names(NAMES, [expression])


@pytest.mark.parametrize(
    "condition, selected",
    [
        ("s.startswith(('rgb', 'lidar'))", ["rgb_1", "rgb_2", "lidar_1"]),
        ("s.split('_')[0] == 'rgb'", ["rgb_1", "rgb_2"]),
        ("s[:3] == 'rgb' and s[-1] == '2'", ["rgb_2"]),
        ("s.replace('_', '').strip('r') == 'gb1'", ["rgb_1"]),
        ("'_'.join(s.split('_')[:1]) == 'lidar'", ["lidar_1"]),
        ("any(s.endswith(c) for c in ['_2', '2'])", ["rgb_2", "12"]),
        ("all(c in '12' for c in s)", ["12"]),
        ("s in ['rgb_' + str(k) for k in range(1, 9) if k % 2 == 0]", ["rgb_2"]),
        ("s in [str(k).zfill(2) for k in range(0, 20, 4)]", ["12"]),
        ("int(s) in range(0, 20, 3) if s.isdigit() else False", ["12"]),
        ("s.isdigit() and (int(s) // 5) * 2 == 4", ["12"]),
        ("s.isdigit() and int(s) / 8 == 1.5", ["12"]),
        ("s.isdigit() and abs(int(s) - 10) < 3", ["12"]),
        ("(len(s) > 2) & (s[0] == 'r') | (s == '12')", ["rgb_1", "rgb_2", "12"]),
        ("set(s) == {'1', '2'}", ["12"]),
        ("s in [*list(('12', 'rgb_1')), *sorted({'rgb_1'})]", ["rgb_1", "12"]),
        ("max(len(s), 3) == 3 and min(s) == '1' and sum([1, 2]) == 3", ["12"]),
        ("s is not None and (None or s) == '12'", ["12"]),
        ("s in ('12')", ["12"]),
    ],
)
def test_a_lambda_means_what_python_means(condition, selected):
    assert select_names(NAMES, [f"lambda s: {condition}"]) == selected
    python = eval(f"lambda s: {condition}")  # noqa: S307
    assert [name for name in NAMES if python(name)] == selected


@pytest.mark.parametrize(
    "condition",
    [
        "list(range(10**9))",
        "list(range(999999999))",
        "sum(a for a in range(9999) for b in range(9999))",
        "[[c for c in range(9999)] for d in range(9999)]",
        "99999999999 * 99999999999",
        "'" + "a" * 9000 + "'.replace('a', '" + "b" * 9000 + "')",
        "'a'.zfill(999999999)",
        "('" + "a" * 9000 + "').join([c for c in '" + "a" * 9000 + "'])",
        "int('" + "9" * 5000 + "')",
        "str([1])",
        "[a for l in [list(range(9999))] for a in range(9999) if -1 in l]",
        "min(range(999999999))",
        "any(c == 1.5 for c in range(999999999))",
    ],
)
def test_no_condition_takes_the_memory_or_the_day(condition):
    begin_s = time.process_time()
    with pytest.raises(SelectionError):
        select_names(NAMES, [f"lambda s: {condition}"])
    assert time.process_time() - begin_s < 5.0


def test_a_text_is_in_no_range_however_long():
    with pytest.raises(SelectionError, match="no name matches"):
        select_names(NAMES, ["lambda s: s in range(10000000000)"])


def test_whatever_stands_there_is_selected_or_refused():
    words = "lambda s : s 1 0 'rgb' ( ) [ ] , . int len str range in not and or == < - + % ** * ! "
    words += "/ // & | for if else any( list( .split() .replace( [0] [:1] None {"
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
