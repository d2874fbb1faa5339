"""Sections of an evaluation: pairs with their floor and baselines, errors against the truth."""

from __future__ import annotations

from functools import partial
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from atom_core.report.page import charts
from atom_core.report.page.blocks import (
    Block,
    Cell,
    Chart,
    Folded,
    Gallery,
    Section,
    Table,
    Text,
)
from atom_core.report.page.camera_sections import camera_tables
from atom_core.report.page.given import Document, Given, verdict_of
from atom_core.report.tables import ABSENT, three_digits

_PairKey = Tuple[str, str, str]  # kind, source, target


def pairs_section(given: Given) -> List[Section]:
    """Return averages and pairs of sensors on the test set; nothing without an evaluation."""
    document = given.evaluation
    if document is None:
        return []
    blocks: List[Block] = [Text(told, warns=True) for told in document.get("warnings", [])]
    blocks += _verdicts(document)
    blocks += [_averages(document)] if document["averages"] else []
    pairs = [pair for pair in document["pairs"] if not pair["reverse"]]
    measured = [pair for pair in pairs if pair["skipped"] is None]
    blocks += _bars(measured, document)
    baselines = dict(_baselines(document))
    for unit in dict.fromkeys(pair["unit"] for pair in measured):
        blocks.append(_pairs([p for p in measured if p["unit"] == unit], baselines, unit))
    blocks += camera_tables(document)
    skipped = [
        [pair["source"], pair["target"], pair["kind"], pair["skipped"]]
        for pair in [*pairs, *document.get("between_collections", [])]
        if pair["skipped"] is not None
    ]
    if skipped:
        columns = ["source", "target", "kind", "why"]
        blocks.append(
            Folded(f"{len(skipped)} pairs not measured", [Table("", columns, skipped, words=True)])
        )
    for name, entry in document.get("baselines", {}).items():
        if isinstance(entry, Mapping) and entry.get("skipped"):
            blocks.append(Text(f"Baseline {name}: {entry['skipped']}", warns=True))
    for name in ("annotations_in_doubt", "baselines_left_out"):
        blocks += [Text(told, warns=True) for told in document.get(name, [])]
    return [Section("pairs", "Sensors against one another, on the test set", blocks)]


def _verdicts(document: Document) -> List[Block]:
    """Return what the test set says of each sensor."""
    rows: List[List[Union[str, Cell]]] = []
    for name, entry in verdict_of(document).get("sensors", {}).items():
        grade = str(entry["grade"])
        rows.append([name, Cell(grade, f"grade {grade}"), entry["sentence"], entry["advice"] or ""])
    if not rows:
        return []
    columns = ["sensor", "verdict", "why", "what to do"]
    return [Table("What the test set says of each sensor", columns, rows, words=True)]


def _averages(document: Document) -> Table:
    rows = [
        [
            kind,
            _three(entry["rms"]),
            _three(entry.get("at_truth")),
            entry["unit"],
            str(entry["pairs"]),
        ]
        for kind, entry in document["averages"].items()
    ]
    note = (
        "RMS: mean over the pairs of the mean over the collections, as in ATOM. At the truth: the "
        "same labels with the true edges, which is the floor that labels set."
    )
    columns = ["kind", "RMS", "at the truth", "unit", "pairs"]
    return Table("Averages by kind of pair", columns, rows, note=note)


def _baselines(document: Document) -> Iterator[Tuple[str, Dict[_PairKey, Mapping[str, Any]]]]:
    """Yield the name of each baseline with its pairs, and what the result was compared with."""
    entries = dict(document.get("baselines", {}))
    if "compared_with" in document:
        entries["compared with"] = document["compared_with"]
    for name, entry in entries.items():
        pairs = entry.get("pairs", []) if isinstance(entry, Mapping) else entry
        if pairs:
            yield name, {(p["kind"], p["source"], p["target"]): p for p in pairs}


def _pairs(
    pairs: Sequence[Mapping[str, Any]],
    baselines: Mapping[str, Mapping[_PairKey, Mapping[str, Any]]],
    unit: str,
) -> Table:
    rows = []
    for pair in pairs:
        key = (pair["kind"], pair["source"], pair["target"])
        at_truth = pair["at_truth"] and pair["at_truth"]["rms"]
        others = [_three(of_one.get(key, {}).get("rms")) for of_one in baselines.values()]
        counts = [str(pair["collections"]), str(pair["points"])]
        names = [f"{pair['source']} → {pair['target']}", pair["kind"]]
        rows.append([*names, *counts, _three(pair["rms"]), _three(at_truth), *others])
    columns = ["pair", "kind", "collections", "points", f"RMS [{unit}]", "at the truth"]
    names = [name.replace("_", " ") for name in baselines]
    return Table(f"Pairs in {unit}", [*columns, *names], rows)


def _bars(pairs: Sequence[Mapping[str, Any]], document: Document) -> List[Block]:
    items = []
    for unit in dict.fromkeys(pair["unit"] for pair in pairs):
        averages = {k: v for k, v in document["averages"].items() if v["unit"] == unit}
        if not averages:
            continue
        groups: Dict[str, List[Optional[float]]] = {
            "this calibration": [entry["rms"] for entry in averages.values()]
        }
        floor = [entry.get("at_truth") for entry in averages.values()]
        if any(value is not None for value in floor):
            groups["at the truth"] = floor
        draw = partial(charts.draw_bars, names=list(averages), groups=groups, unit=f"RMS, {unit}")
        alt = f"Averages of the kinds of pairs in {unit}: {', '.join(averages)}"
        items.append(Chart(f"Averages in {unit}", alt, draw))
    return [Gallery(items, wide=True)] if items else []


def truth_section(given: Given) -> List[Section]:
    """Return errors against the truth, where it is known, beside those of baselines."""
    documents = [d for d in (given.evaluation, given.calibration) if d and d.get("ground_truth")]
    if not documents:
        return []
    document = documents[0]
    entries = {**document.get("baselines", {}), "compared with": document.get("compared_with")}
    others = {
        name: entry["ground_truth"]
        for name, entry in entries.items()
        if isinstance(entry, Mapping) and entry.get("ground_truth")
    }
    rows = []
    for name, error in document["ground_truth"].items():
        cells = _truth_cells(error)
        cells += [_in_words(of_one.get(name)) for of_one in others.values()]
        rows.append(["mean" if name == "mean" else name, *cells])
    columns = ["sensor", "off by [mm]", "turned by [deg]", *others]
    note = (
        "In relation to the sensor that is held, or to the first one; where this is itself "
        "estimated, or alone, it stands with the error of its own edge. Mean: without a reference "
        "that was held."
    )
    note += " Baselines: millimetres and degrees." if others else ""
    table = Table("Error of each sensor", columns, rows, note=note)
    return [Section("truth", "Against the truth", [table])]


def _truth_cells(error: Mapping[str, Any]) -> List[str]:
    metres, degrees = error.get("translation_error_m"), error.get("rotation_error_deg")
    return [
        ABSENT if metres is None else f"{1e3 * metres:.2f}",
        ABSENT if degrees is None else f"{degrees:.3f}",
    ]


def _in_words(error: Optional[Mapping[str, Any]]) -> str:
    return ABSENT if error is None else ", ".join(_truth_cells(error))


def _three(value: Optional[float]) -> str:
    return three_digits(value) or ABSENT
