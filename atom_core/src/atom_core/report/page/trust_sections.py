"""Sections of what is asked without a truth: parts against one another, and has the rig moved?"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, Dict, List, Mapping, Tuple

from atom_core.report.page import charts
from atom_core.report.page.blocks import Block, Chart, Gallery, Section, Table, Text
from atom_core.report.page.given import Document, Given
from atom_core.report.tables import ABSENT, three_digits

_HALVES, _LEFT_OUT, _LOOPS = "two halves", "boards of the others", "loops"


def trust_section(given: Given) -> List[Section]:
    """Return the checks without a truth; nothing where they were not asked for."""
    checks = None if given.calibration is None else given.calibration.get("trust_checks")
    if not checks:
        return []
    blocks: List[Block] = [
        Text(f"{_capital(told)}.", warns=True) for told in checks["contradictions"]
    ]
    questions = _questions(checks)
    rows = [
        [name, question, f"{entry['sigmas']:.2f}", f"{limit:.2f}", *_sizes(entry)]
        for question, (limit, entries) in questions.items()
        for name, entry in entries.items()
    ]
    if questions:
        items = [_chart(question, *found) for question, found in questions.items()]
        blocks.append(Gallery(items))
    columns = ["sensors", "asked", "sigmas", "limit", "shift [mm]", "turn [deg]"]
    note = (
        "Two halves of the collections solved apart; each sensor by the boards as the others have "
        "them; the poses of each two of three sensors around a loop. One sound rig in a hundred is "
        "beyond a limit."
    )
    blocks.append(Table("Differences, in standard deviations", columns, rows, note=note))
    blocks += [Text(f"Not asked: {why}") for why in checks["not_asked"]]
    return [Section("trust", "Asked without a truth", blocks)]


Question = Tuple[float, Dict[str, Mapping[str, Any]]]


def _questions(checks: Mapping[str, Any]) -> Dict[str, Question]:
    """Return limit and differences by sensors of each question that was asked."""
    loops = {", ".join(entry["sensors"]): entry for entry in checks["loops"]["triangles"]}
    found: Dict[str, Question] = {}
    for question, part, entries in (
        (_HALVES, checks["split_half"], checks["split_half"].get("sensors", {})),
        (_LEFT_OUT, checks["leave_one_out"], checks["leave_one_out"].get("sensors", {})),
        (_LOOPS, checks["loops"], loops),
    ):
        if entries:
            found[question] = float(part["limit_sigmas"]), dict(entries)
    return found


def _chart(question: str, limit: float, entries: Mapping[str, Mapping[str, Any]]) -> Chart:
    names = sorted(entries, key=lambda name: -float(entries[name]["sigmas"]))[:12]
    sigmas = [float(entries[name]["sigmas"]) for name in names]
    draw = partial(charts.draw_limit, names=names, values=sigmas, limit=limit, label="sigmas")
    alt = f"{question}: at most {max(sigmas):.1f} sigmas, the limit is {limit:.1f}"
    return Chart(f"{question}; line: the limit", alt, draw)


def changes_section(given: Given) -> List[Section]:
    """Return what moved since another calibration, or by new boards; nothing without such."""
    blocks: List[Block] = []
    for document in given.changes:
        blocks.append(Text(f"{_capital(document['sentence'])}.", warns=bool(document["moved"])))
        if document.get("contradiction"):
            blocks.append(Text(str(document["contradiction"]), warns=True))
        blocks += [Text(f"{_capital(w)}.", warns=True) for w in document.get("warnings", ())]
        blocks.append(_changes(document))
    return [Section("changes", "Has the rig moved?", blocks)] if blocks else []


def _changes(document: Document) -> Table:
    rows = []
    for edge, entry in document["edges"].items():
        name = ", ".join(entry["sensors"]) or edge
        verdict = entry["verdict"].replace("_", " ")
        rows.append([name, verdict, *_sizes(entry), three_digits(entry["chi_square"]) or ABSENT])
    for name, joint in document.get("joints", {}).items():
        verdict, square = joint["verdict"].replace("_", " "), three_digits(joint.get("chi_square"))
        rows.append([name, verdict, *_size_of_joint(joint), square or ABSENT])
    before = document.get("before", document.get("against"))
    after = document.get("after", document.get("dataset"))
    note = (
        f"From {before} to {after}. Moved: chi-square beyond {document['limit_chi_square']:.1f}"
        f"{_of_joints(document)}, as of {100.0 * document['false_alarm_rate']:g} rigs in a hundred "
        f"that did not move."
    )
    columns = ["sensors", "verdict", "shift [mm]", "turn [deg]", "chi-square"]
    return Table("What moved", columns, rows, note=note)


def _of_joints(document: Document) -> str:
    limit = document.get("limit_chi_square_of_joints")
    return "" if limit is None else f" (of a joint's one number {limit:.1f})"


def _size_of_joint(joint: Mapping[str, Any]) -> List[str]:
    if joint["unit"] == "rad":
        return [ABSENT, f"{math.degrees(joint['change']):.3f}"]
    return [f"{1e3 * joint['change']:.2f}", ABSENT]


def _sizes(entry: Mapping[str, Any]) -> List[str]:
    return [f"{1e3 * entry['translation_m']:.2f}", f"{math.degrees(entry['rotation_rad']):.3f}"]


def _capital(text: str) -> str:
    text = text.strip().rstrip(".")
    return text[:1].upper() + text[1:]
