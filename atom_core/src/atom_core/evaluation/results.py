"""What is known of a pair of sensors: figures by collection and pattern, and their means."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, List, Mapping, Optional, Tuple

from atom_core.evaluation.board_displacement import Displacement
from atom_core.evaluation.pairs import Pair
from atom_core.evaluation.statistics import Errors, Figures, figures, mean_of


@dataclass(frozen=True)
class Row:
    """Figures of one collection and one pattern."""

    collection: str
    pattern: str
    figures: Figures


@dataclass(frozen=True)
class PairFigures:
    """Figures of a pair of sensors.

    Attributes:
        rows: by collection and pattern.
        per_collection: by collection, its patterns pooled.
        rms, x_mean_abs, y_mean_abs, x_std_abs, y_std_abs, translation_mm, rotation_deg:
            unweighted means over the collections, as ATOM's table has them.
        pooled: figures of all errors of all collections together.
    """

    rows: Tuple[Row, ...]
    per_collection: Mapping[str, Figures]
    rms: float
    x_mean_abs: Optional[float]
    y_mean_abs: Optional[float]
    x_std_abs: Optional[float]
    y_std_abs: Optional[float]
    translation_mm: Optional[float]
    rotation_deg: Optional[float]
    pooled: Figures


@dataclass(frozen=True)
class PairResult:
    """A pair, measured or skipped.

    Attributes:
        pair: which sensors, and how they are compared.
        measured: with the calibrated edges; None when skipped.
        at_truth: the same labels with the true edges; None without a truth.
        skipped: why nothing was measured.
        unmeasured: why, of collections in which both detect the same pattern.
        unseen: points that the target image does not show.
        displacement: how far the boards' planes have the source elsewhere; None where they were
            not asked.
    """

    pair: Pair
    measured: Optional[PairFigures]
    at_truth: Optional[PairFigures] = None
    skipped: Optional[str] = None
    unmeasured: Mapping[str, str] = field(default_factory=dict)
    unseen: int = 0
    displacement: Optional[Displacement] = None
    turned_rad: Optional[float] = None


def summarised(errors: Mapping[Tuple[str, str], Errors]) -> PairFigures:
    """Return the figures of a pair from its errors by (collection, pattern)."""
    by_collection: Dict[str, List[Errors]] = {}
    for (collection, _), part in errors.items():
        by_collection.setdefault(collection, []).append(part)
    per_collection = {key: figures(parts) for key, parts in by_collection.items()}
    values = list(per_collection.values())
    return PairFigures(
        rows=tuple(Row(key, pattern, figures([e])) for (key, pattern), e in errors.items()),
        per_collection=per_collection,
        rms=float(mean_of([v.rms for v in values]) or 0.0),
        x_mean_abs=mean_of([v.x_mean_abs for v in values]),
        y_mean_abs=mean_of([v.y_mean_abs for v in values]),
        x_std_abs=mean_of([v.x_std_abs for v in values]),
        y_std_abs=mean_of([v.y_std_abs for v in values]),
        translation_mm=mean_of([v.translation_mm for v in values]),
        rotation_deg=mean_of([v.rotation_deg for v in values]),
        pooled=figures(list(errors.values())),
    )
