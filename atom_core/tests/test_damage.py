"""What Hypothesis draws in `make test` is the same whatever ran before."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("hypothesis")

DRAWING = """
import sys
sys.path.insert(0, sys.argv[1])
from damage import damaged, for_all
drawn = []
def check(document):
    drawn.append(repr(document))
for_all(damaged({"a": [1, 2.5, "three"], "b": {"c": None}}), 200, check)
print(hash(tuple(drawn)))
"""


def drawn(before):
    return subprocess.run(
        [sys.executable, "-c", f"{before}\n{DRAWING}", str(Path(__file__).parent)],
        env={"PYTHONHASHSEED": "0", "PYTHONPATH": ":".join(sys.path)},
        stdout=subprocess.PIPE,
        check=True,
    ).stdout


def test_draws_do_not_depend_on_the_modules_that_are_loaded():
    plain = drawn("")
    assert drawn("import atom_core.model.dataset, atom_core.geometry.se3") == plain
