"""What every labeler takes and returns, and which one belongs to a modality."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable, Iterable, Mapping, Optional, Protocol, Tuple, runtime_checkable

import numpy as np

from atom_core.errors import ConfigError
from atom_core.model.config import PatternConfig
from atom_core.model.labels import Label, RangeLabel
from atom_core.model.modality import modalities, modality_named
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

_WHOLE = 0.95  # share of a board in view

_WHOLE_ELSEWHERE = (
    "the view cuts the board at the seed ({:.0%} of it are in view), so that its size is not "
    "known, and a whole board of the configured size stands elsewhere; put the seed there, or "
    "bring all of this one into view"
)


@dataclass(frozen=True)
class Labeled:
    """What a labeler found.

    Attributes:
        label: of the board; empty when it was not detected.
        reason: why it was not detected, one sentence for the user; empty when it was.
        quality: figures by name, the unit in the name (``plane_rms_m``); also of rejected boards.
        item_quality: (n,) for each corner or index of the label, 0 worthless to 1 faultless; None
            where the modality knows none.
        next_seed: where to look for the board in the next data: (2,) pixel of a depth image,
            (3,) point [m] of a cloud; None where the modality needs none or nothing was found.
        warnings: what the user should know though a label was found.
        unsure: where nothing was detected, the label of what may be the board, but of which these
            data do not tell the size, since the edge of the view cuts it, or which may be another
            one than a whole board beside it. It holds where another sensor sees the board there.
    """

    label: Label
    reason: str = ""
    quality: Mapping[str, float] = field(default_factory=dict)
    item_quality: Optional[np.ndarray] = None
    next_seed: Optional[np.ndarray] = None
    warnings: Tuple[str, ...] = ()
    unsure: Optional[Labeled] = None

    @property
    def detected(self) -> bool:
        """Tell whether the board was found."""
        return self.label.detected


def nothing(
    modality: str,
    reason: str,
    quality: Optional[Mapping[str, float]] = None,
    unsure: Optional[Labeled] = None,
) -> Labeled:
    """Return the result of a labeler that did not find the board."""
    empty = modality_named(modality).labels.empty
    return Labeled(empty, reason=reason, quality=quality or {}, unsure=unsure)


def unless_whole_elsewhere(
    found: Labeled, modality: str, search: Callable[[], Iterable[Labeled]]
) -> Labeled:
    """Return what was found at a seed, unsure where a whole board stands elsewhere.

    Args:
        found: a range sensor's; only where the view cuts it, so that one side alone is measured,
            anything is searched for.
        modality: of the sensor.
        search: what a search of the same data finds.
    """
    in_view = found.quality.get("in_view", 1.0)
    is_measured = {"measured_width_m", "measured_height_m"} <= set(found.quality)
    if not found.detected or in_view >= _WHOLE or is_measured:
        return found
    for other in search():
        is_whole = other.detected and other.quality.get("in_view", 1.0) >= _WHOLE
        if is_whole and not _overlap(found.label, other.label):
            return nothing(modality, _WHOLE_ELSEWHERE.format(in_view), found.quality, found)
    return found


def _overlap(label: Label, other: Label) -> bool:
    assert isinstance(label, RangeLabel) and isinstance(other, RangeLabel)
    return bool(np.intersect1d(label.indices, other.indices).size)


class Labeler(Protocol):
    """Finds one pattern in the data of one sensor. It keeps no state between calls."""

    def label(self, data: Any, seed: Optional[np.ndarray] = None) -> Labeled:
        """Label one image or cloud.

        Args:
            data: the image (height, width[, 3]) uint8, the depth image (height, width) [m], or
                the cloud, as the modality's module describes it.
            seed: where the board is, as ``Labeled.next_seed``; None: search for it.
        """


@runtime_checkable
class Preparing(Protocol):
    """A labeler with work to do that needs no seed: it is done once, and any thread may do it."""

    def prepare(self, data: Any) -> Any:
        """Return data in a form that ``label`` takes, too, with that work done."""


def prepared(labeler: Labeler, data: Any) -> Any:
    """Return data for a labeler, with all done that needs no seed."""
    return labeler.prepare(data) if isinstance(labeler, Preparing) else data


def labeler_for(sensor: Sensor, pattern: Pattern, config: PatternConfig) -> Labeler:
    """Return the labeler of a sensor for a pattern.

    Raises:
        ConfigError: there is none for the sensor's modality.
    """
    if sensor.kind.labeler is None:
        labeled = ", ".join(m.name for m in modalities() if m.labeler is not None)
        raise ConfigError(
            f"sensor '{sensor.name}': there is no labeler for modality {sensor.modality}; "
            f"use {labeled}, or leave the sensor out"
        )
    return sensor.kind.labeler(sensor, pattern, config)
