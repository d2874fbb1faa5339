"""Labels of hard scenes by kind of sensor: found of what a person sees, and false ones.

``python3 tests/benchmarks/bench_hard_labels.py [--frames 40]``; 40 of each kind make 200 frames of
LiDARs of a difficulty. A label is false when more than 5 % of its points lie off the board and off
what touches it, or its limit points off the border.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Dict, List

import numpy as np

from atom_core.report.tables import text_table

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "atom_core" / "tests" / "labeling"))
from hard_labels import at_the_other, judged, measured  # noqa: E402
from hard_scenes import DIFFICULTIES, KINDS, hard_frame  # noqa: E402


def main() -> None:
    """Print found boards with a seed and by search, false labels, and the time of a search."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=8, help="of each difficulty and kind")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), metavar="KIND")
    args = parser.parse_args()
    rows, false, seconds = [], 0, {kind: [] for kind in args.kinds}
    for difficulty in DIFFICULTIES:
        row = [difficulty]
        for kind in args.kinds:
            if difficulty == "sun" and kind != "depth":
                row.append("")
                continue
            found, wrong = counted(difficulty, kind, args.frames, seconds)
            false += wrong
            row.append(found + (f", {wrong} FALSE" if wrong else ""))
        rows.append(row)
    both = "label with a seed and by search [ms]"
    rows.append([both, *(f"{1e3 * np.mean(seconds[kind]):.0f}" for kind in args.kinds)])
    title = f"Hard scenes, {args.frames} frames each: found with a seed, by search; {false} false"
    print(text_table(["", *args.kinds], rows, title))


def counted(difficulty: str, kind: str, frames: int, seconds: Dict[str, List[float]]):
    """Return what was found of what a person sees, as text, and the number of false labels."""
    found, expected, false = np.zeros(2, int), np.zeros(2, int), 0
    for number in range(frames):
        frame = hard_frame(difficulty, kind, number)
        seen = measured(frame)
        start = time.process_time()
        labels = judged(frame, seen)
        seconds[kind].append(time.process_time() - start)
        for k, label in enumerate(labels):
            if label is not None:
                expected[k] += label.expected
                found[k] += label.expected and label.found
        tried = [*labels, at_the_other(frame, seen)]
        false += sum(label.false for label in tried if label is not None)
    shares = [f"{f}/{e}" if e else "-" for f, e in zip(found, expected)]
    return ", ".join(shares), false


if __name__ == "__main__":
    main()
