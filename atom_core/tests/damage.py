"""Documents and texts with a few places that are not as they should be, drawn by Hypothesis."""

import importlib
import math
from contextlib import suppress
from copy import deepcopy

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

with suppress(ImportError):  # of an earlier Hypothesis, which does not look at constants
    # It draws from the constants of whatever modules are loaded, too: with that, the draws of
    # `make test` would depend on which tests ran before.
    importlib.import_module("hypothesis.internal.conjecture.providers").is_local_module_file = (
        lambda _: False
    )

NAMES = ["", " ", "a b", "a: b", "%s", "../x", "/etc/passwd", "\0", "\n", "'", '"', "<a>", "é"]
NAMES += ["$(rm x)", "${1/0}", "x" * 300, "\ud800", "1", "nan"]
NUMBERS = [0, -1, 1, 2, 3, 7, 0.5, -0.0, 1e-300, 1e300, 1e308, -1e30, 2**31, 2**63, 10**25]
NUMBERS += [math.nan, math.inf, -math.inf]
SCALARS = st.one_of(
    *(st.none(), st.booleans(), st.sampled_from(NUMBERS), st.integers(-5, 5), st.floats(-10, 10)),
    *(st.sampled_from(NAMES), st.text(max_size=5)),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.sampled_from(NAMES) | st.text(max_size=3), inner, max_size=3),
    ),
    max_leaves=5,
)
_FIRST = 50  # keys or items of one level, among which one is drawn
OF_JSON = ["", "{", "}", "[", "]", ":", ",", "null", "NaN", "1e999", "9" * 5000, "[" * 2000, '"']
OF_YAML = ["- ", "&a ", "*a", "!!python/object:os.system ", "\t", "\n", "? ", "%YAML 9", "---\n"]
OF_YAML += ["...", "<<: ", "{a: " * 200, "#", "|", "=", "2001-01-01", "~", "0x", "'"]
OF_XML = ["<", ">", "/>", "&", "&lt;", "<!--", "-->", "]]>", "<![CDATA[", "<?xml?>", "<a>" * 300]
OF_XML += ["<link/>", '<link name="a"/>', '<origin xyz="1 2"/>', '"', "nan", "1e999", ' rpy="0 0"']
ODD = ["\0", "\ufeff", "\ud800", "\r", "é", " "]


@st.composite
def damaged(draw, document):
    """Draw a document (maps and lists) with one to three changes."""
    document = deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        _change(draw, document)
    return document


def _change(draw, node):
    keys = _keys(node)
    while keys:
        key = draw(st.sampled_from(keys))
        if isinstance(node[key], (dict, list)) and node[key] and draw(st.integers(0, 5)):
            node, keys = node[key], _keys(node[key])
            continue
        how = draw(st.sampled_from(["value"] * 3 + ["gone", "renamed", "other", "more", "cut"]))
        if how == "value":
            node[key] = draw(VALUES)
        elif how == "gone":
            del node[key]
        elif how == "renamed" and isinstance(node, dict):
            node[draw(st.sampled_from(NAMES))] = node.pop(key)
        elif how == "other":
            node[key] = deepcopy(node[draw(st.sampled_from(keys))])
        elif how == "more" and isinstance(node, list):
            node.extend(node[:3])
        elif how == "cut" and isinstance(node[key], (list, str)):
            node[key] = node[key][: len(node[key]) // 2]
        return


def _keys(node):
    return (list(node) if isinstance(node, dict) else list(range(len(node))))[:_FIRST]


@st.composite
def spliced(draw, text, pieces):
    """Draw a text in which one to four places were cut out, or hold something else."""
    for _ in range(draw(st.integers(1, 4))):
        at, cut = draw(st.integers(0, len(text))), draw(st.sampled_from([0, 0, 1, 3, 20]))
        piece = draw(st.sampled_from([*pieces, *ODD]) | st.text(max_size=3))
        text = text[:at] + piece + text[at + cut :]
    return text


@st.composite
def spliced_bytes(draw, data):
    """Draw bytes of which one to four were changed, and perhaps the end is missing."""
    data = bytearray(data)
    for _ in range(draw(st.integers(1, 4))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    end = draw(st.none() | st.integers(0, len(data)))
    return bytes(data[:end])


def for_all(strategy, examples, check):
    """Call a check for some draws; the first hundreds are the same in every run."""
    settings(
        max_examples=examples,
        derandomize=examples < 1000,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )(given(strategy)(check))()
