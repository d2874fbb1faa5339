"""Feeds the compiled module what no sensor and no editor writes, for seconds of processor time.

    python3 native_fuzzer.py SEED SECONDS [FIRST]

Each input follows from SEED and its number. Before the call the number is written to the file that
FUZZED_INPUT names, so that what kills the process can be called again (FIRST). All but a result
or a ValueError ends the program, and so does an input that takes too long or too much memory.
"""

import itertools
import os
import random
import resource
import sys
import time

import numpy as np

from atom_core import native

LONGEST_S = float(os.environ.get("FUZZED_LONGEST_S", "20"))  # of one input
LONGEST_TEXT = 100_000  # bytes of a description that is still repeated
MOST_MB = 1000.0  # what all of them may add to the process
NUMBERS = [0.0, -0.0, 1.0, -1.0, 1e-300, 1e-30, 1e30, 1e300, np.nan, np.inf, -np.inf, 0.1, 5.0]
COUNTS = [-(2**63), -1, 0, 1, 2, 3, 7, 2**31 - 1, 2**31, 2**32, 2**62, 2**63 - 1]
URDF = b"""<?xml version="1.0"?><robot name="rig"><link name="a"/><link name="b"/><link name="c"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<origin xyz="0 1 2" rpy="0.1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
<mimic joint="k" multiplier="2" offset="1"/></joint>
<joint name="k" type="fixed"><parent link="b"/><child link="c"/></joint></robot>"""
PIECES = [b"", b"<", b">", b"/", b'"', b"\0", b"\xff", b"&", b"NaN", b"1e999", b"-1", b"<a>" * 300]
PIECES += [b"<link/>", b'<link name="a"/>', b"<!--", b"]]>", b"<![CDATA[", b" ", b"9" * 400]


def cloud(drawn):
    """Return (points, ring, width, height) of a board before a wall, and what damage does to it."""
    rows, columns = drawn.choice([(16, 120), (1, 300), (4, 60), (32, 40), (2, 2), (1, 1)])
    azimuth = np.linspace(-0.6, 0.6, columns)[None, :] + np.zeros((rows, 1))
    opening = drawn.choice([0.25, 0.25, 0.25, 1e-3, 1e-9])
    elevation = np.linspace(-opening, opening, rows)[:, None] + np.zeros((1, columns))
    ahead = np.where(np.abs(azimuth) < 0.2, 2.0, 4.0)
    points = np.stack([ahead, ahead * np.tan(azimuth), ahead * np.tan(elevation)], axis=-1)
    points = points.reshape(-1, 3)
    ring = np.repeat(np.arange(rows), columns)
    width, height = columns, rows
    chance = np.random.default_rng(drawn.getrandbits(32))
    for _ in range(drawn.randint(0, 4)):
        kind, size = drawn.randrange(8), len(points)
        chosen = chance.integers(0, size, max(int(size * drawn.choice([0.01, 0.3, 1.0])), 1))
        if kind == 0:
            points[chosen, drawn.randrange(3)] = drawn.choice(NUMBERS)
        elif kind == 1:
            points[chosen] = drawn.choice(NUMBERS)
        elif kind == 2:
            points[chosen] = points[chosen[0]]
        elif kind == 3:
            points *= drawn.choice([1e-200, 1e-9, 1e9, 1e150])
        elif kind == 4 and len(ring):
            ring[chosen % len(ring)] = drawn.choice(COUNTS)
        elif kind == 5:
            ring = ring[: drawn.choice([0, 1, size - 1, size])]
        elif kind == 6:
            width, height = drawn.choice([width, *COUNTS]), drawn.choice([height, *COUNTS])
        else:
            points = points + chance.normal(0.0, drawn.choice([1e-3, 0.1, 10.0]), points.shape)
    return points, ring.astype(np.int64), width, height


def mostly(drawn, usual):
    """Return a usual number, and one in ten times an unusual one."""
    return drawn.choice(NUMBERS) if drawn.random() < 0.1 else usual


def boards(core, drawn):
    scan = core.find_layers(*cloud(drawn))
    scan.layer_of_points(100_000)
    width, height = mostly(drawn, 0.8), mostly(drawn, 0.6)
    least = drawn.choice([3, 3, 2, 0, -1, 2**31 - 1])
    beam, dark = mostly(drawn, drawn.choice([0.0, 0.003])), mostly(drawn, drawn.choice([0.0, 0.1]))
    seed = np.array([mostly(drawn, 2.0) for _ in range(2 if drawn.random() < 0.02 else 3)])
    if drawn.random() < 0.5:
        core.segment_board(scan, seed * [1.0, 0.0, 0.0][: len(seed)], width, height, least, beam)
    else:
        core.find_boards(scan, width, height, least, beam, dark)


def description(core, drawn):
    text = bytearray(URDF)
    for _ in range(drawn.randint(1, 5)):
        place = drawn.randrange(len(text))
        text[place : place + drawn.choice([0, 1, 9, 60])] = drawn.choice(PIECES)
        if drawn.random() < 0.1 and len(text) < LONGEST_TEXT:  # five times 50 would fill the memory
            text = text * drawn.choice([2, 50])
    core.parse_urdf(bytes(text))


def compression(core, drawn):
    points = cloud(drawn)[0]
    weights = np.ones(len(points) + drawn.choice([0, 0, 0, 1]))
    if drawn.random() < 0.3:
        weights[drawn.randrange(len(weights))] = drawn.choice(NUMBERS)
    starts = sorted(drawn.choice([0, 0, 1, len(points), *COUNTS]) for _ in range(3))
    if drawn.random() < 0.5:
        core.compress_planar_rows(points, weights)
    else:
        core.compress_planar_segments(points, weights, np.array(starts, dtype=np.int64))


def main():
    seed, seconds, first = (*map(float, sys.argv[1:]), 0.0)[:3]
    core, noted = native.require("Fuzzing"), os.environ.get("FUZZED_INPUT", os.devnull)
    refused, begin = 0, time.process_time()
    small_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in itertools.count(int(first)):
        with open(noted, "w", encoding="ascii") as file:
            file.write(f"{number}\n")
        drawn = random.Random(f"{seed:.0f} {number}")
        start = time.process_time()
        try:
            drawn.choice((boards, boards, description, compression))(core, drawn)
        except ValueError:
            refused += 1
        took = time.process_time() - start
        if took > LONGEST_S:
            raise SystemExit(f"input {number} takes {took:.0f} s")
        if time.process_time() - begin > seconds:
            break
    more_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - small_kb) / 1024.0
    print(f"{number + 1 - int(first)} inputs, {refused} refused, {more_mb:.0f} MB more")
    if more_mb > MOST_MB:
        raise SystemExit(f"memory grew by {more_mb:.0f} MB")


if __name__ == "__main__":
    main()
