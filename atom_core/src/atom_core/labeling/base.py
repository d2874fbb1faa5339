"""What every labeler takes and returns, and which one belongs to a modality."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Protocol, Tuple, runtime_checkable

import numpy as np

from atom_core.errors import ConfigError
from atom_core.model.config import PatternConfig
from atom_core.model.labels import Label
from atom_core.model.modality import modalities, modality_named
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor


@dataclass(frozen=True)
class Labeled:
    """What a labeler found.

    Attributes:
        label: of the board; empty when it was not detected.
        reason: why it was not detected, one sentence for the user; empty when it was.
        quality: figures by name, the unit in the name (``plane_rms_m``); also of rejected boards.
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
