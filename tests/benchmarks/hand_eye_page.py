"""The page docs/results/hand_eye.md from the figures of bench_hand_eye.py."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Sequence

HEAD = """# Hand-eye calibration against OpenCV's methods

Written by `make bench-hand-eye`; do not edit. {seeds} simulated rigs of each kind, OpenCV
{opencv}, {date}. A camera of an arm sees a ChArUco that stands still, or a camera that
stands still sees one on the arm: 15 collections, boards partly out of the image, 5 % of the
corners lost, corners wrong by 0.3 px along each axis. All get the same labels and poses of the
arm. OpenCV's methods get the board's pose in each image by planar PnP, refined in pixels. Ours
starts 0.1 m and 0.1 rad off.

The error is that of the camera's calibrated edge against the truth. *Best of seven / ours*: how
many times larger the error of the best of the seven methods is, figure by figure; above 1 ours
is better than each of them.
"""

NOTES = """## What to read from it

* The defaults are better than each of the seven in the median and at the 90th percentile.
* With poses that are off by half a millimetre and 0.03 deg the boards contradict the arm. The
  defaults then estimate how far off it is, as `--moving_edge_sigma flange` does, and say so. An arm
  that is off by more than 0.8 mm or 0.1 deg is named instead, together with the option.
* Poses that are off by 0.1 mm and 0.01 deg do not show beside the corners' noise. Who knows of them
  gains by the option; with an exact arm it costs little.
* *Said*: how often each status came, and the worst of the six numbers of the pose in its stated
  sigma, in the median and the largest of all rigs.
* Tsai's and Daniilidis' methods lose turns near half a turn between two collections, which the
  arm with the board makes: there they are wrong by decimetres, or without an answer.
* Tsai's, Horaud's and Daniilidis' methods of OpenCV depend on the frames that they are given. Here
  they get the parents of the camera's edge and of the board. With the arm's base instead, which is
  how they are called as a rule where the board is on the arm, they are wrong by metres in most
  of these rigs, even without noise; the commands by ATOM's names then end with exit code 1.
"""

REAL = """## On a real arm

Eight pictures of a chessboard from a camera on a real arm (the tutorial of ViSP), whose reported
poses are wrong by millimetres, with its published answer. There is no truth: the distances from
the published answer (its own residual is 5.41 mm and 0.456 deg) say how much the methods agree,
no more. Reprojection and spread are on the same pictures, through the arm's poses.
"""


def page(document: Mapping[str, Any]) -> str:
    """Return the page."""
    parts = [HEAD.format(**{key: document[key] for key in ("seeds", "opencv", "date")})]
    parts.append(_summary(document["rows"]))
    parts.append(NOTES)
    for row in document["rows"]:
        parts.append(_details(row))
    if document["real"]:
        parts.append(REAL)
        names = list(document["real"][0])
        parts.append(_table(names, [[_cell(r[n]) for n in names] for r in document["real"]]))
    return "\n".join(parts)


def _summary(rows: Sequence[Mapping[str, Any]]) -> str:
    figures = list(next(iter(rows[0]["ratios"].values())))
    cells = []
    for row in rows:
        for ours, ratios in row["ratios"].items():
            reached = all(value > 1.0 for value in ratios.values())
            goal = ("yes" if reached else "**no**") if ours in row["has_to_win"] else ""
            start = [row["rig"], row["arm"], _name(ours)]
            cells.append([*start, *(f"{ratios[f]:.2f}" for f in figures), goal])
    headers = ["rig", "arm's poses off by", "ours with", *figures, "better than each"]
    return "## Best of seven / ours\n\n" + _table(headers, cells)


def _details(row: Mapping[str, Any]) -> str:
    methods: Dict[str, Mapping[str, float]] = row["methods"]
    figures = list(next(iter(methods.values())))
    cells = []
    for name, values in methods.items():
        said = row["said"].get(name, "")
        title = f"ours, {_name(name)}" if name in row["said"] else f"OpenCV {name}"
        cells.append([title, *(_cell(values[f]) for f in figures), said])
    title = f"## {row['rig'].capitalize()}, poses off by {row['arm']}\n\n"
    return title.replace("off by exact", "exact") + _table(["", *figures, "said"], cells)


def _name(ours: str) -> str:
    return f"`{ours}`" if ours.startswith("-") else ours


def _cell(value: Any) -> str:
    if isinstance(value, float):
        if math.isinf(value):
            return "no answer"
        return f"{value:.3f}" if value < 10.0 else f"{value:.1f}"
    return "" if value is None else _name(str(value))


def _table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines: List[Sequence[str]] = [headers, ["---"] * len(headers), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"
