"""What moved, and by how much: a table of the edges, and the tree of transforms."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Optional, Set, Tuple

from atom_core.calibration.refine.moving_parts import moving_sentence
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.report.model_error_lines import estimated_errors
from atom_core.report.page.blocks import Block, Branch, Section, Table, Text, Tree
from atom_core.report.page.given import Document, Given, final_edges, initial_edges
from atom_core.report.tables import ABSENT

_BY_COLLECTION = "a value for each collection"
_NO_START = "where the solver started is not in this result: how far edges moved is not known"


def moves_section(given: Given) -> List[Section]:
    """Return the section of what moved; nothing without a calibration."""
    document = given.calibration
    if document is None:
        return []
    blocks: List[Block] = [_edges_table(document)]
    if not initial_edges(document):
        blocks.append(Text(_NO_START, warns=True))
    if document.get("joints"):
        blocks.append(_joints_table(document["joints"]))
    blocks += _intrinsics(document)
    blocks += [Text(f"Estimated: {e}.") for e in estimated_errors(document.get("model_errors", ()))]
    for part in document.get("moving_parts", ()):
        edge, sigmas = Edge(part["parent"], part["child"]), (part["sigma_m"], part["sigma_rad"])
        blocks.append(Text(f"Beside this, {moving_sentence(edge, sigmas, part['estimated'])}."))
    if given.dataset is not None:
        blocks.append(Tree(transform_tree(given.dataset, document)))
    return [Section("moved", "What moved, and by how much", blocks)]


def moved(document: Document) -> Dict[Edge, Tuple[float, float]]:
    """Return how far each edge is from where it started [mm], [deg]."""
    final, found = final_edges(document), {}
    for edge, start in initial_edges(document).items():
        shift_m, turn_rad = se3.pose_difference(start, final[edge])
        found[edge] = 1e3 * shift_m, math.degrees(turn_rad)
    return found


def sigmas(entry: Mapping[str, Any], combined: bool) -> Optional[Tuple[float, float]]:
    """Return the largest standard deviations of an edge along and about an axis [mm], [deg]."""
    names = [f"{'combined_' * combined}sigma_{what}" for what in ("translation_m", "rotation_rad")]
    if any(name not in entry for name in names):
        return None
    return 1e3 * max(entry[names[0]]), math.degrees(max(entry[names[1]]))


def _edges_table(document: Document) -> Table:
    distances, rows = moved(document), []
    for name, entry in document["edges"].items():
        step = distances.get(Edge(entry["parent"], entry["child"]))
        state = "held" if entry["anchored"] else "estimated"
        if entry.get("sigma_collection") is not None:
            state, step = _BY_COLLECTION, None
        known = sigmas(entry, combined=True) or sigmas(entry, combined=False)
        figures = [ABSENT] * 2 if step is None else [f"{step[0]:.2f}", f"{step[1]:.3f}"]
        held = [ABSENT] * 2 if entry["anchored"] or known is None else _two(known)
        rows.append([", ".join(entry["sensors"]) or name, name, state, *figures, *held])
    columns = ["sensor", "edge (parent-child)", "state", "moved [mm]", "turned [deg]"]
    columns += ["sigma [mm]", "sigma [deg]"]
    note = (
        "Moved and turned: since the start of the solver. Sigma: one standard deviation, the "
        "largest of three axes, with the usual errors of sensors and boards where these are known."
    )
    if any(entry.get("sigma_collection") is not None for entry in document["edges"].values()):
        note += " Of what has a value for each collection, where it is known worst."
    return Table("Edges that were estimated or held", columns, rows, note=note)


def _two(values: Tuple[float, float]) -> List[str]:
    return [f"{values[0]:.2f}", f"{values[1]:.3f}"]


def _joints_table(joints: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Table:
    rows = []
    for joint, parameters in joints.items():
        for name, p in parameters.items():
            factor, unit = (1e3, "mm") if p["unit"] == "m" else (math.degrees(1.0), "deg")
            sigma = p.get("combined_sigma", p["sigma"])
            numbers = [f"{factor * p[key]:.4g}" for key in ("value", "change")]
            rows.append([joint, name, *numbers, f"{factor * sigma:.3g}", unit])
    columns = ["joint", "parameter", "value", "change", "sigma", "unit"]
    return Table("Joints that were estimated", columns, rows)


def _intrinsics(document: Document) -> List[Table]:
    """Return the table of intrinsics in a list; nothing where none were estimated."""
    rows = []
    for name, sensor in document["sensors"].items():
        for parameter, p in sensor.get("intrinsics", {}).items():
            digits, unit = (3, "px") if p["unit"] == "px" else (6, "")
            numbers = [p["value"], p["change"], p.get("combined_sigma", p["sigma"])]
            rows.append([name, parameter, *(f"{n:.{digits}f}" for n in numbers), unit])
    columns = ["camera", "parameter", "value", "change", "sigma", "unit"]
    return [Table("Intrinsics that were estimated", columns, rows)] if rows else []


def transform_tree(dataset: Dataset, document: Document) -> List[Branch]:
    """Return the tree of transforms, reduced to what leads to sensors, boards and moved edges."""
    children: Dict[str, List[str]] = {}
    parents: Dict[str, str] = {}
    edges = {edge for c in dataset.collections.values() for edge in c.transforms}
    edges |= {board_edge(pattern) for pattern in dataset.patterns.values()}
    for parent, child in sorted(edges):
        children.setdefault(parent, []).append(child)
        parents[child] = parent
    notes = _notes(dataset, document)
    kept: Set[str] = set()
    for frame in [child for _, child in notes] + [s.frame for s in dataset.sensors.values()]:
        while frame not in kept:
            kept.add(frame)
            if frame not in parents:
                break
            frame = parents[frame]
    roots = [frame for frame in children if frame not in parents and frame in kept]
    return [_branch(root, "", "", children, kept, notes) for root in roots]


Notes = Dict[Edge, Tuple[str, str]]


def _notes(dataset: Dataset, document: Document) -> Notes:
    """Return what became of each edge that the calibration knows, and its mark."""
    distances, found = moved(document), {}
    for entry in document["edges"].values():
        edge = Edge(entry["parent"], entry["child"])
        names = ", ".join(entry["sensors"]) or str(edge)
        if entry["anchored"]:
            found[edge] = (f"{names}: held where it was", "held")
        elif entry.get("sigma_collection") is not None:
            found[edge] = (f"{names}: {_BY_COLLECTION}", "moved")
        elif edge in distances:
            step = distances[edge]
            found[edge] = (f"{names}: moved {step[0]:.1f} mm, turned {step[1]:.2f} deg", "moved")
        else:
            found[edge] = (f"{names}: estimated", "moved")
    for pattern in dataset.patterns.values():
        where = "one pose for all collections" if pattern.fixed else "a pose for each collection"
        found[board_edge(pattern)] = (f"board {pattern.name}: {where}", "board")
    return found


def _branch(
    frame: str,
    note: str,
    mark: str,
    children: Mapping[str, List[str]],
    kept: Set[str],
    notes: Notes,
) -> Branch:
    """Return a frame with what hangs below it; a row of given edges becomes one line."""
    name = frame
    below = [child for child in children.get(frame, []) if child in kept]
    while len(below) == 1 and Edge(frame, below[0]) not in notes:
        frame = below[0]
        name = f"{name} / {frame}"
        below = [child for child in children.get(frame, []) if child in kept]
    branches = tuple(
        _branch(child, *notes.get(Edge(frame, child), ("", "")), children, kept, notes)
        for child in below
    )
    return Branch(name, note, mark, branches)
