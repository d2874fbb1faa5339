"""decompress(compress(x)) == x for every x; damaged streams are refused."""

import contextlib
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from atom_core.io import lzf

sys.path.insert(0, str(Path(__file__).parent))
from pcd_encodings import compress  # noqa: E402

RNG_SEED = 11


def samples():
    rng = np.random.default_rng(RNG_SEED)
    yield b""
    yield from (bytes([7]) * n for n in (1, 2, 3, 4, 5, 263, 264, 265, 1000))
    for size in (1, 31, 32, 33, 64, 65, 5000, 20_000):
        yield rng.integers(0, 256, size, dtype=np.uint8).tobytes()  # incompressible
        yield rng.integers(0, 2, size, dtype=np.uint8).tobytes()
        yield np.cumsum(rng.integers(-1, 2, size)).astype("<f4").tobytes()
    block = rng.integers(0, 256, 100, dtype=np.uint8).tobytes()
    for gap in (8091, 8092, 8093, 9000):  # around the greatest distance
        yield block + bytes(gap) + block


@pytest.mark.parametrize("data", list(samples()), ids=len)
def test_round_trip(data):
    packed = compress(data)
    assert lzf.decompress(packed, len(data)) == data
    assert len(packed) <= len(data) + len(data) // 32 + 1


def test_hand_made_stream():
    """Literal 'abc', then 9 bytes from 3 back (long form), then 4 bytes from 1 back."""
    stream = bytes([2]) + b"abc" + bytes([0xE0, 0, 2]) + bytes([0x40, 0])
    assert lzf.decompress(stream, 16) == b"abcabcabcabccccc"


@pytest.mark.parametrize(
    "stream, size, what",
    [
        (bytes([2]) + b"ab", 3, "in the middle"),
        (bytes([0x40]), 4, "in the middle"),
        (bytes([0xE0]), 9, "in the middle"),
        (bytes([0x40, 0]), 4, "before their start"),
        (bytes([0]) + b"a" + bytes([0x40, 5]), 5, "before their start"),
        (bytes([1]) + b"ab", 3, "2 bytes instead of 3"),
        (bytes([1]) + b"ab", 1, "2 bytes instead of 1"),
    ],
)
def test_damaged_streams_are_refused(stream, size, what):
    with pytest.raises(ValueError, match=what):
        lzf.decompress(stream, size)


def test_random_bytes_never_crash_otherwise():
    rng = np.random.default_rng(RNG_SEED)
    for _ in range(500):
        stream = rng.integers(0, 256, rng.integers(0, 60), dtype=np.uint8).tobytes()
        with contextlib.suppress(ValueError):
            assert len(lzf.decompress(stream, 100)) == 100


def test_a_cloud_of_65k_points_takes_less_than_a_second():
    angle = np.linspace(0.0, 200.0, 65_536)
    data = np.stack([np.cos(angle), np.sin(angle), angle // 6.28]).astype("<f4").tobytes()
    packed = compress(data)
    start = time.process_time()
    assert lzf.decompress(packed, len(data)) == data
    assert time.process_time() - start < 1.0
