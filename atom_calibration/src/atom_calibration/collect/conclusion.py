"""How a collector ends, whatever its data came from: the dataset, a summary, an exit code."""

from __future__ import annotations

from typing import Callable, List

from atom_calibration.collect.collector import Collector
from atom_calibration.errors import CollectionError
from atom_core.io.collections import CollectionStore

DONE, NOT_ACCEPTABLE = 0, 1


def conclude(
    store: CollectionStore,
    collector: Collector,
    keys: List[str],
    say: Callable[[str], None],
    warn: Callable[[str], None],
) -> int:
    """Assemble the dataset and say what it holds.

    Args:
        store: where the collections are.
        collector: that has taken them.
        keys: of the collections.
        say: is told the summary.
        warn: is told, in one line each, what the user should know.

    Returns:
        The exit code: 1 if a sensor never saw the board, or moments became no collection.

    Raises:
        CollectionError: there is no collection.
        OutputError: the dataset cannot be written.
    """
    if not keys:
        never = "; ".join(
            f"{name}: {reasons.most_common(1)[0][0]}"
            for name, reasons in collector.reasons.items()
            if reasons
        )
        why = collector.refused[0] if collector.refused else "the board never stood still in view"
        raise CollectionError(f"{store.folder}: no collection was taken: {why} ({never})")
    path, _ = store.assemble()
    say("\n".join([*summary(collector, keys), "", f"{path}: {len(keys)} collections"]))
    unseen = [name for name, count in collector.taken.items() if not count]
    for name in unseen:
        warn(f"sensor '{name}' never saw the board in a collection")
    return NOT_ACCEPTABLE if unseen or collector.refused else DONE


def summary(collector: Collector, keys: List[str]) -> List[str]:
    """Return lines for the user: what was collected, and what was not seen."""
    lines = [f"{'sensor':16} detections in {len(keys)} collections"]
    for name, count in collector.taken.items():
        why = ""
        if not count and collector.reasons[name]:
            why = f"  never: {collector.reasons[name].most_common(1)[0][0]}"
        lines.append(f"{name:16} {count:4d}{why}")
    return lines
