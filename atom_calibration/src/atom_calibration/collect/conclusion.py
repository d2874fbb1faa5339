"""How a collector ends, whatever its data came from: the dataset, a summary, an exit code."""

from __future__ import annotations

from typing import Callable, Iterator, List, Mapping

import numpy as np

from atom_calibration.collect.collector import Collector
from atom_calibration.errors import CollectionError
from atom_calibration.labels.frame_labeler import NO_SEED
from atom_core.io.collections import CollectionStore
from atom_core.io.earlier_run import PREVIOUS_FOLDER, has_earlier_run

DONE, NOT_ACCEPTABLE = 0, 1
_OF_CHESSBOARDS = "inner corners is seen"  # in the reason why a chessboard is not found


def conclude(
    store: CollectionStore,
    collector: Collector,
    keys: List[str],
    say: Callable[[str], None],
    warn: Callable[[str], None],
    asked: bool = True,
) -> int:
    """Assemble the dataset and say what it holds.

    Args:
        store: where the collections are.
        collector: that has taken them.
        keys: of the collections.
        say: is told the summary.
        warn: is told, in one line each, what the user should know.
        asked: whether collections were to be taken wherever the board stands still.

    Returns:
        The exit code: 1 if a sensor never saw the board, if moments became no collection, if not
        even half of what looked like a stop did, or if the board is smaller than configured.

    Raises:
        CollectionError: there is no collection, or cameras see the board mirrored to each other;
            what was collected stays to be looked at.
        OutputError: the dataset cannot be written.
    """
    collector.withdraw()
    keys = [key for key in keys if key in store.keys]
    if not keys:
        is_there = "is left" if collector.deleted else "was taken"
        raise CollectionError(
            f"{store.folder}: no collection {is_there}: {why_none(collector, asked)}"
        )
    collector.keep_caveats()
    path, _ = store.assemble()
    path = path.resolve()
    say("\n".join([*summary(collector, keys), "", f"{path}: {len(keys)} collections"]))
    say(f"next: rosrun atom_calibration check --dataset {path}")
    for text in left_out(collector, keys):
        warn(text)
    for text in collector.quality.mirrored():
        raise CollectionError(f"{path}: {text}")
    store.keep()
    bad = list(bad_sensors(collector))
    for text in bad:
        warn(text)
    fewer = len(collector.passed) > len(keys)
    return NOT_ACCEPTABLE if bad or collector.refused or fewer else DONE


def why_none(collector: Collector, asked: bool) -> str:
    """Return why there is no collection; the arguments are those of `conclude`."""
    if collector.deleted:
        others = "".join(f"; {why}" for why in collector.refused[:1])
        return f"{collector.deleted} taken, and deleted again{others}"
    if not (asked or collector.refused or collector.passed):
        return (
            "nobody asked for one; take them with Save in the panel or in the menu of the ball, "
            "or, wherever the board stands still, with --automatic"
        )
    never = "; ".join(
        f"{name}: {_most_often(reasons)}" for name, reasons in collector.reasons.items() if reasons
    )
    whys = [*collector.refused, *collector.passed, "the board never stood still in view"]
    if len(whys) == 1 and not never:  # it was seen in all that came
        return (
            f"{whys[0]}: hold it still at each place; of a recording of single pictures, take "
            f"those of given times: collect_from_bag --times or --interval"
        )
    counted = "; dimension counts inner corners, one less than squares along each side"
    hint = counted if _OF_CHESSBOARDS in never else ""
    return f"{whys[0]} ({never}{hint})" if never else whys[0]


def bad_sensors(collector: Collector) -> Iterator[str]:
    """Yield what is wrong with all that a sensor has, or has not, in the collections."""
    for name, count in collector.taken.items():
        if not count:
            yield f"sensor '{name}' never saw the board in a collection"
    for name in collector.quality.smaller():
        yield (
            f"to sensor '{name}' the board is smaller than configured (both sizes are above): its "
            f"labels are not to be calibrated with; correct the configuration, and collect again"
        )


def give_up(store: CollectionStore, warn: Callable[[str], None]) -> None:
    """Bring back the dataset of before, if nothing was collected, or say where it is kept."""
    if store.give_up_if_empty():
        warn(f"the dataset that was in {store.folder} is back")
    elif has_earlier_run(store.folder):
        warn(
            f"{store.folder / PREVIOUS_FOLDER} keeps the dataset that was here before; `python3 -m "
            f"atom_core recover {store.folder} --previous` brings it back"
        )


def left_out(collector: Collector, keys: List[str]) -> Iterator[str]:
    """Yield what became no part of a collection, and why."""
    for why in collector.passed:
        yield f"a stop is not taken: {why}"
    if collector.repeated:
        yield (
            f"{collector.repeated} moments had the very data of the collection before and are not "
            f"taken: they follow each other faster than the data"
        )
    if collector.stayed:
        yield (
            f"not taken, since the board stands where it stood at the stop before, as far as its "
            f"sensors tell: {collector.stayed} stop{'s' * (collector.stayed > 1)}"
        )
    if collector.again:
        yield (
            f"not taken, since the recording was played again and they are collected already: "
            f"{collector.again} stop{'s' * (collector.again > 1)}"
        )
    if collector.between:
        yield (
            f"{collector.between} moments lie between the data and are not taken: they follow "
            f"each other faster than the data"
        )
    if collector.missed > 1:
        yield (
            f"{collector.missed - 1} more moments have no data within "
            f"{500 * collector.max_skew_s:.0f} ms: raise max_duration_between_msgs"
        )
    for name, apart_ms in collector.apart_ms.items():
        yield (
            f"sensor '{name}' saw the board in {len(apart_ms)} of {len(keys)} collections and is "
            f"not in them: with it their stamps would last {np.median(apart_ms):.0f} ms; raise "
            f"max_duration_between_msgs, or correct its clock (--use_receive_time {name})"
        )


def _most_often(reasons: Mapping[str, int]) -> str:
    """Return the most frequent reason; that of searches, where most frames were not searched."""
    telling = {why: count for why, count in reasons.items() if why != NO_SEED} or reasons
    return max(telling, key=lambda why: telling[why])


def summary(collector: Collector, keys: List[str]) -> List[str]:
    """Return lines for the user: what was collected, and what was not seen."""
    lines = [f"{'sensor':16} detections in {len(keys)} collections"]
    for name, count in collector.taken.items():
        why = ""
        if not count and collector.reasons[name]:
            why = f"  never: {_most_often(collector.reasons[name])}"
        lines.append(f"{name:16} {count:4d}{why}")
    figures = list(collector.quality.summary())
    advice = [f"advice: {line}" for line in collector.quality.advice()]
    advice += [f"warning: {line}" for line in collector.quality.sizes()]
    return [*lines, *([""] + figures if figures else []), *([""] + advice if advice else [])]
