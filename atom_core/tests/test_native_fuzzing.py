"""What no sensor and no editor writes: the compiled module answers or refuses, and never dies.

A quarter of a minute of processor time in `make test`, ten minutes in `make test-long`.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from atom_core import native

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not native.available(), reason="the module is not built"),
]
FUZZER = Path(__file__).with_name("native_fuzzer.py")


@pytest.mark.parametrize(
    "seed, seconds", [(0, 15), pytest.param(1, 600, marks=pytest.mark.long(minutes=11))]
)
def test_any_input_is_answered_or_refused(tmp_path, seed, seconds):
    noted = tmp_path / "input"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(FUZZER), str(seed), str(seconds)],
        env={**os.environ, "FUZZED_INPUT": str(noted)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=60 * seconds,
        check=False,
    )
    assert done.returncode == 0, f"seed {seed}, input {noted.read_text()}: {done.stdout[-2000:]}"
    inputs, refused = [int(word) for word in done.stdout.split() if word.isdigit()][:2]
    assert 0.01 * inputs < refused < 0.9 * inputs, done.stdout


# A board so far away that it was moved 10^10 steps; one of no height: a segmentation fault.
# Beams so near to one another that a board had millions of them: four minutes. A description whose
# tags are never closed: a quarter of a minute.
@pytest.mark.parametrize("seed, number", [(0, 4222), (0, 7758), (1, 150820), (1, 176875)])
def test_what_was_not_answered_once_is_answered_now(seed, number):
    ran = [sys.executable, "-W", "ignore", str(FUZZER), str(seed), "0.01", str(number)]
    done = subprocess.run(ran, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
