"""How well each sensor sees the board: the figures of a frame's labels."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, Optional

import numpy as np

from atom_calibration.modalities.frames import Frame
from atom_core.labeling.stillness import SurfaceSighting
from atom_core.labeling.view_quality import clear_squares, corner_view, surface_view
from atom_core.model.config import PatternConfig
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import Pattern


def board_figures(frame: Frame, pattern: Pattern, config: PatternConfig) -> Dict[str, float]:
    """Return the figures of one label by name, the unit in the name; empty if nothing was found.

    Args:
        frame: labeled, with its data.
        pattern: the board.
        config: its print.
    """
    labeled = frame.labels.get(pattern.name)
    if labeled is None or not labeled.detected:
        return {}
    if isinstance(labeled.label, RgbLabel):
        pose = frame.board_pose(pattern)
        return corner_view(frame.data, pattern, labeled.label, clear_squares(config), pose)
    sighting = frame.sightings.get(pattern.name)
    if not isinstance(sighting, SurfaceSighting):
        return {}
    normal: Optional[np.ndarray] = getattr(sighting, "normal", None)  # a line has none
    return surface_view(sighting.centre, normal)


def add_figures(frame: Frame, pattern: Pattern, config: PatternConfig) -> None:
    """Put the figures of a label beside those of its labeler."""
    figures = board_figures(frame, pattern, config)
    if figures:
        labeled = frame.labels[pattern.name]
        frame.labels[pattern.name] = replace(labeled, quality={**labeled.quality, **figures})
