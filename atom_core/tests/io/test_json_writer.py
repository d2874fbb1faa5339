"""Documents are written as json.dumps has them, whatever they hold, and never held as a text."""

import json
import random
import tracemalloc
from collections import OrderedDict

import numpy as np
import pytest

from atom_core.io.dataset_json import dumps, write_document
from atom_core.io.json_writer import write_json

SCALARS = [
    *(None, True, False, 0, -7, 10**30, 0.1, -0.0, 1e-300, 1e22, np.float64(0.3)),
    *(float("nan"), float("inf"), -float("inf"), "", 'a"\\\n', "câmara µ \U0001f4f7 \ud800"),
]


def drawn(draw, depth):
    """Return a document at random."""
    kind = draw.choice(["scalar", "list", "numbers", "tuple", "map", "ordered"] if depth else "s")
    size = draw.choice([0, 1, 3])
    if kind == "numbers":
        return [draw.choice([3, 0.25, draw.gauss(0.0, 1.0)]) for _ in range(size)]
    if kind in ("list", "tuple"):
        return {"list": list, "tuple": tuple}[kind](drawn(draw, depth - 1) for _ in range(size))
    if kind in ("map", "ordered"):
        items = [(draw.choice("zyxébA\n") * draw.randint(0, 3), drawn(draw, depth - 1))]
        items += [(f"k{i}", drawn(draw, depth - 1)) for i in reversed(range(size))]
        return {"map": dict, "ordered": OrderedDict}[kind](items)
    return draw.choice(SCALARS)


def written(document, **options):
    pieces = []
    write_json(document, pieces.append, **options)
    return "".join(pieces)


@pytest.mark.parametrize("sort_keys", [True, False])
def test_the_text_is_that_of_json(sort_keys):
    draw = random.Random(3)
    for _ in range(300):
        document = drawn(draw, 5)
        assert written(document, sort_keys=sort_keys) == json.dumps(
            document, indent=2, sort_keys=sort_keys
        )
    for key in (1, 2.5, True, None):
        assert written({key: [key]}) == json.dumps({key: [key]}, indent=2)


def test_documents_are_as_deep_as_json_takes_them():
    document = 1
    for _ in range(400):
        document = {"a": [document]}
    assert written(document) == json.dumps(document, indent=2, sort_keys=True)


def test_what_json_does_not_know_is_made_of_it_or_refused():
    assert written([np.int64(3)], default=lambda value: value.item()) == "[\n  3\n]"
    for value in ({1, 2}, [{1, 2}], {(1, 2): 3}):
        with pytest.raises(TypeError, match="set|tuple"):
            written(value)
    for value in (np.nan, [1.0, np.inf], {"a": (-np.inf, "")}, {np.nan: 1}):
        with pytest.raises(ValueError, match="not finite"):
            written(value, allow_nan=False)


def test_a_label_of_many_points_needs_no_memory_to_be_written(tmp_path):
    labels = {name: {"idxs": list(range(300, 60_000))} for name in "abcdefgh"}
    text = dumps(labels)
    tracemalloc.start()
    write_document(tmp_path / "dataset.json", labels)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tmp_path / "dataset.json").read_text(encoding="utf-8") == text
    assert peak < len(text), "one label's text at a time"
