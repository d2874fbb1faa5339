"""How well each sensor sees the board: the figures of a frame's labels."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, Optional

import numpy as np

from atom_calibration.modalities.frames import Frame, points_of
from atom_core.labeling.guidance import all_round_box, image_box, normal_figures
from atom_core.labeling.stillness import SurfaceSighting
from atom_core.labeling.view_quality import clear_squares, corner_view, surface_view
from atom_core.model.config import PatternConfig
from atom_core.model.labels import Label, RangeLabel, RgbLabel
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
    place = _place(frame, labeled.label)
    if isinstance(labeled.label, RgbLabel):
        pose = frame.board_pose(pattern)
        figures = corner_view(frame.data, pattern, labeled.label, clear_squares(config), pose)
        turned = {} if pose is None else normal_figures(pose[:3, 2])
        return {**figures, **place, **turned}
    sighting = frame.sightings.get(pattern.name)
    if not isinstance(sighting, SurfaceSighting):
        return place
    normal: Optional[np.ndarray] = getattr(sighting, "normal", None)  # a line has none
    turned = {} if normal is None else normal_figures(normal)
    return {**surface_view(sighting.centre, normal), **place, **turned}


def _place(frame: Frame, label: Label) -> Dict[str, float]:
    """Return where in the sensor's view a label lies, as shares of the view."""
    camera = frame.sensor.camera
    if isinstance(label, RgbLabel):
        assert camera is not None
        return image_box(label.pixels, camera.width, camera.height)
    assert isinstance(label, RangeLabel)
    if camera is None:
        return all_round_box(points_of(frame, label.indices).astype(float))
    row, column = np.divmod(label.indices, camera.width)
    return image_box(np.column_stack([column, row]), camera.width, camera.height)


def add_figures(frame: Frame, pattern: Pattern, config: PatternConfig) -> None:
    """Put the figures of a label beside those of its labeler."""
    figures = board_figures(frame, pattern, config)
    if figures:
        labeled = frame.labels[pattern.name]
        frame.labels[pattern.name] = replace(labeled, quality={**labeled.quality, **figures})
