"""A picture of the transform tree, in the manner of Fig. 1 of Rato et al. (2022).

Green arrows are estimated, blue ones move, green nodes are frames of data, the red node is the
pattern, whose edge is both. Branches without anything that matters are folded.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import Any, Dict, List, Mapping, Set

import networkx

from atom_calibration.errors import ToolError
from atom_core.model.config import CalibrationConfig
from atom_core.model.robot import FIXED

GREEN, BLUE, RED, ORANGE, GREY = "#2e8b3d", "#1f5fb4", "#c8342b", "#d9730d", "#8a8a8a"
_FILL = {"world": "#e4e4e4", "sensor": "#cdebc9", "pattern": "#f6c6c1"}
_LINE = {"world": "#444444", "sensor": GREEN, "pattern": RED}
FORMATS = ("pdf", "svg")
_NO_DATE = {"SOURCE_DATE_EPOCH": "0"}  # the same tree, the same bytes
_TIMEOUT_S = 60


def dot_text(graph: networkx.DiGraph, config: CalibrationConfig) -> str:
    """Return the tree as a text of the language DOT.

    Args:
        graph: see `atom_calibration.configure.tree.networkx_graph`.
        config: says what matters, and which sensor is held.
    """
    kept = _frames_that_matter(graph, config)
    lines = [
        "digraph transforms {",
        '  graph [rankdir=TB, ranksep=0.45, nodesep=0.18, fontname="Helvetica", labelloc=t,',
        f"         label={_quoted(_title(config))}, fontsize=18];",
        '  node [shape=box, style="rounded,filled", fillcolor=white, color="#777777",',
        '        fontname="Helvetica", fontsize=12, height=0.3, margin="0.10,0.05"];',
        f'  edge [color="{GREY}", arrowsize=0.7, fontname="Helvetica", fontsize=10];',
    ]
    lines += [_node(name, graph.nodes[name], config) for name in sorted(kept)]
    lines += [
        _edge(parent, child, graph.edges[parent, child], config)
        for parent, child in sorted(graph.edges)
        if parent in kept and child in kept
    ]
    lines += _folded(graph, kept)
    return "\n".join([*lines, *_legend(graph), "}", ""])


def draw(dot: str, kind: str) -> bytes:
    """Return a picture of a DOT text.

    Args:
        dot: the text.
        kind: pdf, svg or png.

    Raises:
        ToolError: the program dot is absent, or fails.
    """
    program = shutil.which("dot")
    if program is None:
        raise ToolError("the program `dot` is absent; install graphviz (apt install graphviz)")
    try:
        result = subprocess.run(
            [program, f"-T{kind}"],
            input=dot.encode(),
            capture_output=True,
            env={**os.environ, **_NO_DATE},
            timeout=_TIMEOUT_S,
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        words = (getattr(error, "stderr", None) or str(error).encode()).decode(errors="replace")
        raise ToolError(f"dot cannot draw the tree: {words.strip()}; report this") from error
    return result.stdout


def _frames_that_matter(graph: networkx.DiGraph, config: CalibrationConfig) -> Set[str]:
    """Return the world, and all frames on the way to sensors, patterns and what is estimated."""
    ends = {name for name, attributes in graph.nodes.items() if "role" in attributes}
    for _parent, child, attributes in graph.edges(data=True):
        if attributes["is_transformation_calibrated"] or attributes["joint_params_calibrated"]:
            ends.add(child)
    kept = {config.world_link}
    for end in ends:
        kept |= {end, *networkx.ancestors(graph, end)}
    return kept


def _node(name: str, attributes: Mapping[str, Any], config: CalibrationConfig) -> str:
    role = attributes.get("role")
    if role is None:
        return f"  {_quoted(name)};"
    label = name
    if role == "sensor":
        described = [f"{s} ({config.sensors[s].modality or '?'})" for s in attributes["names"]]
        label = "\\n".join([*described, name])
    elif role == "pattern":
        label = "\\n".join([*attributes["names"], name])
    style = f'fillcolor="{_FILL[role]}", color="{_LINE[role]}", penwidth=1.6'
    return f"  {_quoted(name)} [label={_quoted(label)}, {style}];"


def _edge(parent: str, child: str, attributes: Mapping[str, Any], config: CalibrationConfig) -> str:
    style = {"color": f'"{GREY}"'}
    moves = attributes["type"] != FIXED
    names, parameters = attributes["estimated"], attributes["joint_params_calibrated"]
    if moves:
        style = {"color": f'"{BLUE}"', "penwidth": "1.4"}
    if names:
        # a board moves and is estimated: both colours, side by side
        colour = f"{BLUE}:{GREEN}" if moves else GREEN
        style = {"color": f'"{colour}"', "penwidth": "2.4", "fontcolor": f'"{GREEN}"'}
        others = [name for name in names if name not in config.sensors]
        if others and others[0] in config.additional_tfs:
            style["label"] = _quoted(", ".join(others))
        if config.anchored_sensor in names:
            style.update(style="dashed", label=_quoted("held"))
    if parameters:
        style = {"color": f'"{ORANGE}"', "penwidth": "2.4", "fontcolor": f'"{ORANGE}"'}
        style["label"] = _quoted("\\n".join([attributes["joint_name"], *parameters]))
    if attributes["from_bag"]:
        style["arrowhead"] = "open"
    listed = ", ".join(f"{key}={value}" for key, value in style.items())
    return f"  {_quoted(parent)} -> {_quoted(child)} [{listed}];"


def _folded(graph: networkx.DiGraph, kept: Set[str]) -> List[str]:
    """Return one small node for all the frames below a frame that do not matter."""
    lines = []
    for frame in sorted(kept):
        branches = [child for child in graph.successors(frame) if child not in kept]
        count = len(branches) + sum(len(networkx.descendants(graph, b)) for b in branches)
        if count:
            name = _quoted(f"folded below {frame}")
            words = branches[0] if count == 1 else f"{count} more frames"
            lines.append(
                f"  {name} [label={_quoted(words)}, shape=plaintext, style=solid, fontsize=10, "
                f'fontcolor="{GREY}"];'
            )
            lines.append(f"  {_quoted(frame)} -> {name} [style=dotted, arrowhead=none];")
    return lines


def _legend(graph: networkx.DiGraph) -> List[str]:
    """Return a table that explains what is in the picture."""
    edges = [attributes for _, _, attributes in graph.edges(data=True)]
    rows = [("&rarr;", GREEN, "estimated (dashed: held)")]
    if any(e["type"] != FIXED for e in edges):
        rows.append(("&rarr;", BLUE, "moves"))
    if any(e["joint_params_calibrated"] for e in edges):
        rows.append(("&rarr;", ORANGE, "joint with estimated parameters"))
    if any(e["from_bag"] for e in edges):
        rows.append(("&#8702;", GREY, "open head: only in the bag"))
    rows += [
        ("&#9632;", _FILL["sensor"], "frame of data"),
        ("&#9632;", _FILL["pattern"], "pattern"),
    ]
    cells = "".join(
        f'<TR><TD><FONT COLOR="{colour}" POINT-SIZE="16">{sign}</FONT></TD>'
        f'<TD ALIGN="LEFT">{words}</TD></TR>'
        for sign, colour, words in rows
    )
    table = f'<TABLE BORDER="1" CELLBORDER="0" CELLSPACING="2" COLOR="#bbbbbb">{cells}</TABLE>'
    return [f'  "legend " [shape=plaintext, style=solid, fontsize=11, label=<{table}>];']


def _title(config: CalibrationConfig) -> str:
    counts: Dict[str, int] = {}
    for sensor in config.sensors.values():
        modality = sensor.modality or "?"
        counts[modality] = counts.get(modality, 0) + 1
    sensors = ", ".join(f"{count} {modality}" for modality, count in counts.items())
    patterns = len(config.calibration_patterns)
    return f"{sensors}; {patterns} pattern{'s' if patterns > 1 else ''}\n "


def _quoted(text: str) -> str:
    """Return a text in quotes; line breaks written as backslash n stay line breaks."""
    escaped = text.replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
