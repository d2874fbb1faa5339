"""RVL is read as its paper has it: every image comes back, and damage ends in a ValueError."""

import struct

import numpy as np
import pytest

from atom_core.io.encoded_images import MOST_PIXELS
from atom_core.io.rvl import decode_rvl, rvl_image_size


def packed(image):
    """Return an image (height, width) uint16 as the transport packs it, number by number."""
    nibbles, depths, before, i = [], image.ravel().tolist(), 0, 0

    def put(number):
        while True:
            nibbles.append((number & 7) | (8 if number >> 3 else 0))
            number >>= 3
            if not number:
                return

    while i < len(depths):
        measured = next((k for k in range(i, len(depths)) if depths[k]), len(depths))
        end = next((k for k in range(measured, len(depths)) if not depths[k]), len(depths))
        put(measured - i)
        put(end - measured)
        for depth in depths[measured:end]:
            put(2 * (depth - before) if depth >= before else 2 * (before - depth) - 1)
            before = depth
        i = end
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        int("".join(f"{n:x}" for n in nibbles[k : k + 8]), 16) for k in range(0, len(nibbles), 8)
    ]
    return struct.pack("<II", *image.shape[::-1]) + struct.pack(f"<{len(words)}I", *words)


def drawn_image(rng):
    shape = tuple(rng.integers(1, 13, 2))
    kinds = [
        rng.integers(0, 2, shape),
        rng.integers(1500, 1600, shape),
        rng.integers(0, 2**16, shape),
    ]
    return np.choose(rng.integers(0, 3, shape), kinds).astype(np.uint16)


IMAGES = [
    np.zeros((2, 3), np.uint16),
    np.full((2, 3), 2**16 - 1, np.uint16),
    *(drawn_image(np.random.default_rng(seed)) for seed in range(100)),
]


def test_every_image_comes_back():
    for image in IMAGES:
        data = packed(image)
        np.testing.assert_array_equal(decode_rvl(data), image)
        assert rvl_image_size(data) == image.shape[::-1]


def test_another_encoder_packs_the_same():
    """By rvl 1.0.4 and pyrvl 0.0.1."""
    image = np.array([[0, 1500, 1501], [1499, 0, 0]], np.uint16)
    assert packed(image)[8:].hex() == "23e58f1300000020"


def test_what_is_cut_off_is_refused():
    for image in IMAGES[1:]:
        data = packed(image)
        for at in range(0, len(data), 4):
            with pytest.raises(ValueError, match="empty|cut off"):
                decode_rvl(data[:at])


def test_any_bytes_are_an_image_or_refused():
    rng = np.random.default_rng(0)
    outcomes = set()
    for _ in range(2000):
        width, height = rng.integers(0, 20, 2)
        nibbles = rng.choice([0x00, 0x11, 0x90, 0xFF], rng.integers(0, 100)).astype(np.uint8)
        try:
            image = decode_rvl(struct.pack("<II", width, height) + nibbles.tobytes())
            assert image.shape == (height, width)
            outcomes.add("read")
        except ValueError as error:
            outcomes.add(str(error).split(" after ")[0].split(" than ")[0])
    assert outcomes == {
        "read",
        "it is empty",
        "the depths are cut off",
        "it is damaged: a number has more",
        "it is damaged: more",
    }


def test_a_size_that_is_not_there_is_refused_before_memory_is_taken():
    with pytest.raises(ValueError, match=r"4294967295 x 2 pixels; at most 200 million"):
        decode_rvl(struct.pack("<II", 2**32 - 1, 2) + bytes(100))
    with pytest.raises(ValueError, match="cut off"):
        decode_rvl(struct.pack("<II", MOST_PIXELS // 2, 2) + bytes(100))
