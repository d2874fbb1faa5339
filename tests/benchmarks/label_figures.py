"""Figures of labels out of the comparison with the truth: one row for each goal."""

from __future__ import annotations

from typing import Callable, List, NamedTuple, Sequence

import numpy as np
from label_truth import Sight

from atom_core.model.sensor import DEPTH, LIDAR3D, RGB

WELL_SEEN_PX, WELL_SEEN_DEG = 22.0, 60.0  # of a square from the front, of the board


class Figure(NamedTuple):
    """A measured figure and its goal.

    Attributes:
        what: in words.
        measured: with its unit.
        goal: with its unit; empty where there is none.
        reached: None where there is no goal.
    """

    what: str
    measured: str
    goal: str = ""
    reached: object = None


def label_figures(sights: Sequence[Sight]) -> List[Figure]:
    """Return the figures of all sensors' labels."""
    figures: List[Figure] = []
    for modality, name in ((LIDAR3D, "LiDAR"), (DEPTH, "depth")):
        figures += _range_figures([s for s in sights if s.modality == modality], name)
    figures += _camera_figures([s for s in sights if s.modality == RGB])
    return figures


def found_figures(sights: Sequence[Sight], name: str) -> List[Figure]:
    """Return how many boards were found against how many geometry gives, of one dataset."""
    figures = []
    for modality in (RGB, LIDAR3D, DEPTH):
        chosen = [s for s in sights if s.modality == modality]
        found, there = sum(s.found for s in chosen), sum(s.to_be_found for s in chosen)
        share = found / there
        figures.append(
            Figure(
                f"{name}: {modality} detections, found / by geometry",
                f"{found} / {there}",
                "0.8 to 1.2",
                0.8 <= share <= 1.2,
            )
        )
    return figures


def _range_figures(sights: Sequence[Sight], name: str) -> List[Figure]:
    wanted, found = [s for s in sights if s.to_be_found], [s for s in sights if s.found]
    hits, false = sum(s.found and not s.false for s in wanted), sum(s.false for s in found)
    precision = 1.0 - _total(found, "wrong") / _total(found, "labeled")
    recall = _total(found, "recalled") / _total(found, "should")
    border = 1e3 * np.concatenate([s.border_m for s in found])
    return [
        Figure(
            f"{name}: boards found of those that geometry allows",
            f"{hits} / {len(wanted)}",
            ">= 95 %",
            hits >= 0.95 * len(wanted),
        ),
        Figure(f"{name}: false boards", f"{false}", "0", false == 0),
        Figure(
            f"{name}: precision of the points", f"{precision:.4f}", ">= 0.98", precision >= 0.98
        ),
        Figure(f"{name}: recall of the points", f"{recall:.4f}", ">= 0.9", recall >= 0.9),
        Figure(
            f"{name}: limit points outside the border, mean, RMS",
            f"{border.mean():.1f}, {np.sqrt(np.mean(border**2)):.1f} mm",
        ),
    ]


def _camera_figures(sights: Sequence[Sight]) -> List[Figure]:
    false = sum(s.false for s in sights)
    figures = [Figure("RGB: false boards", f"{false}", "0", false == 0)]
    strict, others = (
        f"squares >= {WELL_SEEN_PX:g} px, incidence <= {WELL_SEEN_DEG:g} deg",
        "smaller or flatter",
    )
    figures += _corner_figures([s for s in sights if _well_seen(s)], strict, True)
    figures += _corner_figures([s for s in sights if not _well_seen(s)], others, False)
    return figures


def _well_seen(sight: Sight) -> bool:
    return sight.square_px >= WELL_SEEN_PX and sight.incidence_deg <= WELL_SEEN_DEG


def _corner_figures(sights: Sequence[Sight], name: str, strict: bool) -> List[Figure]:
    wanted, found = [s for s in sights if s.to_be_found], [s for s in sights if s.found]
    hits = sum(s.found for s in wanted)
    error = np.concatenate([s.error_px for s in found])
    bias, rms = error.mean(axis=0), np.sqrt(np.mean(error**2, axis=0))

    def figure(what: str, text: str, goal: str, reached: Callable[[], bool]) -> Figure:
        what = f"RGB, {name}: {what}"
        return Figure(what, text, goal, bool(reached())) if strict else Figure(what, text)

    return [
        figure(
            "boards found", f"{hits} / {len(wanted)}", ">= 95 %", lambda: hits >= 0.95 * len(wanted)
        ),
        figure(
            "bias x, y",
            f"{bias[0]:+.4f}, {bias[1]:+.4f} px",
            "<= 0.05 px",
            lambda: np.all(np.abs(bias) <= 0.05),
        ),
        figure(
            "RMS x, y", f"{rms[0]:.3f}, {rms[1]:.3f} px", "<= 0.18 px", lambda: np.all(rms <= 0.18)
        ),
    ]


def _total(sights: Sequence[Sight], name: str) -> int:
    return sum(getattr(s, name) for s in sights)
