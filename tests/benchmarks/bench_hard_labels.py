"""Labels of hard scenes by kind of sensor: found of what a person sees, and false ones.

``python3 tests/benchmarks/bench_hard_labels.py [--frames 200] [--first 1000] [--save FILE]``. A
label is false when more than 5 % of its points lie off the board and off what touches it, or its
limit points off the border. The labelers were made with frames below 1000. In brackets: how many
show a quarter of three sides, where not all do; of the others nothing tells where the board ends.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path
from typing import Iterator, List, NamedTuple

import numpy as np

from atom_core.report.tables import text_table

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "atom_core" / "tests" / "labeling"))
from hard_labels import at_the_other, judged, measured  # noqa: E402
from hard_scenes import DIFFICULTIES, KINDS, hard_frame  # noqa: E402

WAYS = ("with a seed", "by search", "seed on another board")


class Tried(NamedTuple):
    """A frame that was labeled in one of the ``WAYS``."""

    difficulty: str
    kind: str
    number: int
    way: str
    expected: bool
    found: bool
    false: bool
    is_placed: bool
    milliseconds: float
    reason: str


def main() -> None:
    """Print found boards with a seed and by search, false labels, and the time of a search."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=8, help="of each difficulty and kind")
    parser.add_argument("--first", type=int, default=1000, help="number of the first frame")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), metavar="KIND")
    parser.add_argument("--difficulties", nargs="+", default=list(DIFFICULTIES), metavar="NAME")
    parser.add_argument("--save", metavar="FILE", help="write each label that was tried as CSV")
    args = parser.parse_args()
    numbers = range(args.first, args.first + args.frames)
    tried: List[Tried] = []
    rows = []
    for difficulty in args.difficulties:
        row = [difficulty]
        for kind in args.kinds:
            here = (
                []
                if difficulty == "sun" and kind != "depth"
                else list(labels(difficulty, kind, numbers))
            )
            tried += here
            row.append(summary(here))
        rows.append(row)
        if args.save:
            save(args.save, tried)
    both = "a label [ms]"
    rows.append([both, *(mean_time(tried, kind) for kind in args.kinds)])
    false = sum(label.false for label in tried)
    title = f"Hard scenes, {args.frames} frames each: found with a seed, by search; {false} false"
    print(text_table(["", *args.kinds], rows, title))


def labels(difficulty: str, kind: str, numbers: range) -> Iterator[Tried]:
    """Yield what was tried of some frames."""
    for number in numbers:
        frame = hard_frame(difficulty, kind, number)
        seen = measured(frame)
        start = time.process_time()
        both = judged(frame, seen)
        took = 1e3 * (time.process_time() - start) / sum(label is not None for label in both)
        for way, label in zip(WAYS, [*both, at_the_other(frame, seen)]):
            if label is not None:
                found = label.expected and label.found
                result = (bool(label.expected), bool(found), bool(label.false), label.is_placed)
                yield Tried(difficulty, kind, number, way, *result, took, label.labeled.reason)


def summary(tried: List[Tried]) -> str:
    """Return what was found of what a person sees, and the number of false labels."""
    shares = []
    for way in WAYS[:2]:
        expected = [label for label in tried if label.way == way and label.expected]
        found = sum(label.found for label in expected)
        placed = sum(label.is_placed for label in expected)
        least = f" ({placed})" if placed < len(expected) else ""
        shares.append(f"{found}/{len(expected)}{least}" if expected else "-")
    false = sum(label.false for label in tried)
    return (", ".join(shares) + (f", {false} FALSE" if false else "")) if tried else ""


def mean_time(tried: List[Tried], kind: str) -> str:
    """Return the mean time of a label of some kind of sensor [ms]."""
    times = [label.milliseconds for label in tried if label.kind == kind and label.way in WAYS[:2]]
    return f"{np.mean(times):.0f}" if times else ""


def save(path: str, tried: List[Tried]) -> None:
    """Write what was tried as CSV."""
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(Tried._fields)
        writer.writerows(tried)


if __name__ == "__main__":
    main()
