"""The paper's tables pair by pair: its figures, ours, those at the truth, and each baseline's."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from paper_figures import FURTHER_KINDS, METHODS, TABLES, Names, PaperTable

from atom_core.evaluation.baselines.chain import KALIBR

MM_PER_M = 1000.0
Document = Mapping[str, Any]  # an ``evaluation.json``


class Link(NamedTuple):
    """A baseline's pose of one sensor in another, beside the calibration's.

    Attributes:
        rms: the baseline's by kind of pair; None where nothing could be measured.
        off_mm, off_deg: its error against the truth.
        here_mm, here_deg: the calibration's.
    """

    rms: Mapping[str, Optional[float]]
    off_mm: float
    off_deg: float
    here_mm: float
    here_deg: float


Links = Mapping[str, Mapping[Names, Link]]  # by method and pair, of one seed


def paper_tables(
    documents: Sequence[Document], methods: Sequence[str] = METHODS
) -> List[Dict[str, Any]]:
    """Return Tables 2 to 6 and the further kinds of pairs.

    Args:
        documents: one ``evaluation.json`` for each seed, with the baselines.
        methods: the baselines to show.
    """
    links = [{method: links_of(document, method) for method in methods} for document in documents]
    tables = [_table(table, documents, links) for table in TABLES]
    for (kind, title), like in ((item, TABLES[1]) for item in FURTHER_KINDS.items()):
        pairs = dict.fromkeys(like.pairs)
        further = like._replace(kind=kind, title=title, pairs=pairs, baselines={})
        tables.append(_table(further, documents, links, of_paper=False))
    return tables


def links_of(document: Document, method: str) -> Dict[Names, Link]:
    """Return the links of a method by (source, target), as the pairs of the tables name them."""
    found = {}
    for link in document["baselines"].get(method, {}).get("links", ()):
        rms = {pair["kind"]: pair["rms"] for pair in link["pairs"]}
        errors = [
            (MM_PER_M * link[f"{whose}translation_error_m"], link[f"{whose}rotation_error_deg"])
            for whose in ("", "calibration_")
        ]
        names = {(pair["source"], pair["target"]) for pair in link["pairs"]}
        found.update(dict.fromkeys(names, Link(rms, *errors[0], *errors[1])))
    return found


def _table(
    table: PaperTable,
    documents: Sequence[Document],
    links: Sequence[Links],
    of_paper: bool = True,
) -> Dict[str, Any]:
    rows = [_pair(table, names, documents, links) for names in table.pairs]
    averages = [document["averages"][table.kind] for document in documents]
    return {
        "number": table.number if of_paper else None,
        "title": table.title,
        "kind": table.kind,
        "unit": table.unit,
        "goal": table.goal if of_paper else None,
        "pairs": rows,
        "average": {
            "paper": table.average if of_paper else None,
            "here": spread([average["rms"] for average in averages]),
            "at_truth": spread([average["at_truth"] for average in averages]),
            "baselines": {method: _average(rows, method) for method in links[0]},
        },
    }


def _pair(
    table: PaperTable, names: Names, documents: Sequence[Document], links: Sequence[Links]
) -> Dict[str, Any]:
    measured = [_measured(document, table.kind, names) for document in documents]
    here = [pair["rms"] for pair in measured]
    floor = [pair["at_truth"]["rms"] for pair in measured]
    baselines = {}
    for method in links[0]:
        found = [of_seed[method].get(names) for of_seed in links]
        of_paper = table.baselines.get(method, {}).get(names)
        if any(found) or method in table.baselines:
            baselines[method] = _of_method(found, table.kind, of_paper)
    return {
        "source": names[0],
        "target": names[1],
        "paper": table.pairs[names],
        "paper_kalibr": table.baselines.get(KALIBR, {}).get(names),
        "here": spread(here),
        "at_truth": spread(floor),
        "ratios": [ours / least for ours, least in zip(here, floor)],
        "baselines": baselines,
    }


def _measured(document: Document, kind: str, names: Names) -> Mapping[str, Any]:
    for pair in document["pairs"]:
        if pair["kind"] == kind and (pair["source"], pair["target"]) == names:
            return pair
    raise SystemExit(f"{kind}: the evaluation has no pair {names[0]}, {names[1]}")


def _of_method(
    found: Sequence[Optional[Link]], kind: str, of_paper: Optional[float]
) -> Dict[str, Any]:
    """Return a method's figures of a pair; means are over the seeds in which it has an answer."""
    known = [link for link in found if link is not None]
    rms = [link.rms.get(kind) for link in known]
    return {
        "paper": of_paper,
        "rms": spread([value for value in rms if value is not None]),
        "off_mm": spread([link.off_mm for link in known]),
        "off_deg": spread([link.off_deg for link in known]),
        "here_mm": spread([link.here_mm for link in known]),
        "here_deg": spread([link.here_deg for link in known]),
        "here_nearer": sum(link.here_mm < link.off_mm for link in known),
        "solved": len(known),
        "seeds": len(found),
    }


def _average(rows: Sequence[Mapping[str, Any]], method: str) -> Dict[str, Optional[float]]:
    """Return the mean of a method's pairs, as the paper has it: of those that it could solve."""
    found = [row["baselines"][method] for row in rows if method in row["baselines"]]
    papers = [entry["paper"] for entry in found if entry["paper"] is not None]
    means = [entry["rms"]["mean"] for entry in found if entry["rms"]["values"]]
    return {
        "paper": float(np.mean(papers)) if papers else None,
        "rms": float(np.mean(means)) if means else None,
    }


def spread(values: Sequence[float]) -> Dict[str, Any]:
    """Return mean and standard deviation of some values, with them; None of nothing."""
    known = [float(value) for value in values]
    return {
        "mean": float(np.mean(known)) if known else None,
        "std": float(np.std(known)) if known else None,
        "values": known,
    }


def rigs_against_truth(documents: Sequence[Document]) -> List[Dict[str, Any]]:
    """Return a row for each baseline and sensor of the rig that its links make.

    Both errors are in the sensor that stays, over the seeds in which the baseline places it.
    """
    rows = []
    for method in METHODS:
        entries = [document["baselines"].get(method, {}) for document in documents]
        sensors = [entry.get("sensors", {}) for entry in entries]
        for name in dict.fromkeys(name for of_seed in sensors for name in of_seed):
            found = [of_seed[name] for of_seed in sensors if name in of_seed]
            rows.append({"method": method, "sensor": name, **_of_sensor(found)})
    return rows


def _of_sensor(found: Sequence[Mapping[str, float]]) -> Dict[str, Any]:
    mm = {
        whose: [MM_PER_M * entry[f"{whose}translation_error_m"] for entry in found]
        for whose in ("", "calibration_")
    }
    deg = {
        whose: [entry[f"{whose}rotation_error_deg"] for entry in found]
        for whose in ("", "calibration_")
    }
    off, here = spread(mm[""]), spread(mm["calibration_"])
    return {
        "off_mm": off,
        "off_deg": spread(deg[""]),
        "here_mm": here,
        "here_deg": spread(deg["calibration_"]),
        "times": off["mean"] / here["mean"],
        "here_nearer": sum(ours < theirs for ours, theirs in zip(mm["calibration_"], mm[""])),
        "seeds": len(found),
    }


def camchain_of_truth(documents: Sequence[Document]) -> Optional[float]:
    """Return by how much a camchain of the truth, imported, differs from the truth [px].

    The largest over pairs and seeds: it shows that Kalibr's file is read as it is meant.
    """
    found = [
        abs(pair["rms"] - pair["at_truth_rms"])
        for document in documents
        for link in document["baselines"].get(KALIBR, {}).get("links", ())
        for pair in link["pairs"]
    ]
    return max(found) if found else None


def single_cameras(documents: Sequence[Document]) -> List[Dict[str, Any]]:
    """Return each camera's corners against where the board is projected, over the seeds [px]."""
    names = dict.fromkeys(entry["sensor"] for d in documents for entry in d["single_cameras"])
    return [
        {
            "sensor": name,
            "rms": spread(
                [
                    entry["rms"]
                    for document in documents
                    for entry in document["single_cameras"]
                    if entry["sensor"] == name and entry["skipped"] is None
                ]
            ),
        }
        for name in names
    ]
