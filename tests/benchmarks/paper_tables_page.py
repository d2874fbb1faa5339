"""The paper's tables as Markdown, out of results.json."""

from __future__ import annotations

from typing import Any, List, Mapping, Optional, Sequence

from markdown_tables import number, table

_HEAD = """
## The paper's tables, pair by pair

*Here* is the mean over the seeds and its standard deviation, *ratio* the largest of one seed to the
same pair at the truth. The baselines solve from the same train sets and are measured on the same
test sets. Their cells are *paper / here*, or ours alone, with the number of seeds that could be
solved where that is not all; a dash: none. Metrics of pairs hardly rank methods, since most of what
they show is the floor that labels set; poses against the truth do, and stand below each table.
Averages of the paper's baselines are means of its pairs; for *ICP aligned average* in Table 5 it
prints 2.751, and its three pairs have the mean 3.688.
"""
_SEES = {
    "rgb-rgb": "The board's plane is known from the source's own corners: their noise, carried "
    "over, is the floor.",
    "lidar3d-lidar3d_common": "Some 0.3 of the gap between a LiDAR's layers stays in this metric "
    "with any calibration; it sees errors across the board, and hardly any along it.",
    "lidar3d-lidar3d": "One LiDAR often sees a strip of the board only; the rest of it has no "
    "counterpart, and the figure is large with any calibration.",
    "lidar3d-lidar3d_plane": "This metric has no floor but noise; it sees errors across the board "
    "alone.",
}


def paper_tables_part(document: Mapping[str, Any]) -> str:
    """Return the part of the page."""
    seeds, made = ", ".join(map(str, document["seeds"])), document["made"]
    told = f"Seeds {seeds}; {made['date']}, {made['cores']} cores.\n"
    parts = [_HEAD, told, _table_1(document["table_1"])]
    for entry in document["tables"]:
        parts += [_title(entry), _metrics(entry), _poses(entry)]
        parts += [_SEES[entry["kind"]] + "\n"] if entry["kind"] in _SEES else []
    parts += [_rigs(document["rigs"]), _single(document["single_cameras"])]
    if document["camchain_of_truth_px"] is not None:
        parts.append(
            f"Kalibr itself was not run. A camchain of the truth, imported by `--baseline kalibr`, "
            f"differs from the truth by {document['camchain_of_truth_px']:.1g} px at most.\n"
        )
    return "\n".join(parts)


_DRAWN = """
## The same, with labels drawn at the truth

The cell's labels without its pictures: corners are drawn with 0.3 px of noise along each axis, ten
times what the simulator's pictures give, returns of LiDARs with 10 mm along the ray, depths as
structured light has them. The largest ratio of a pair to the same pair at the truth, by table, and
the rigs that the baselines make, against the truth.
"""


def drawn_part_page(document: Mapping[str, Any]) -> str:
    """Return the part of the page with drawn labels."""
    seeds, made = ", ".join(map(str, document["seeds"])), document["made"]
    body = []
    for entry in document["tables"]:
        mean, rows = entry["average"], entry["pairs"]
        worst = max(rows, key=lambda row: max(row["ratios"]))
        cells = [f"{entry['title']} [{entry['unit']}]", number(mean["paper"])]
        cells += [_spread(mean["here"]), number(mean["at_truth"]["mean"])]
        cells += [f"{max(worst['ratios']):.3f} ({worst['source']} to {worst['target']})"]
        body.append(cells)
    pairs = table(["average over pairs", "paper", "here", "at truth", "largest ratio"], body)
    told = f"Seeds {seeds}; {made['date']}, {made['cores']} cores.\n"
    return "\n".join(
        [_DRAWN, told, pairs, "", _poses(document["tables"][0]), _rigs(document["rigs"])]
    )


def _table_1(rows: Sequence[Mapping[str, Any]]) -> str:
    body = [
        [f"{row['set']}: {row['what']}", str(row["paper"]), ", ".join(map(str, row["here"]))]
        for row in rows
    ]
    return "### Table 1: the datasets\n\n" + table(["", "paper", "here, by seed"], body) + "\n"


def _title(entry: Mapping[str, Any]) -> str:
    number_of = f"Table {entry['number']}: " if entry["number"] else ""
    return f"### {number_of}{entry['title']} [{entry['unit']}]\n"


def _methods(entry: Mapping[str, Any]) -> List[str]:
    """Return the methods that have a figure in a table, in the order of its first rows."""
    found = [m for row in entry["pairs"] for m in row["baselines"]]
    return list(dict.fromkeys(found))


def _metrics(entry: Mapping[str, Any]) -> str:
    methods = _methods(entry)
    kalibr = any(row["paper_kalibr"] is not None for row in entry["pairs"])
    headers = ["pair", "paper", "here", "at truth", "ratio", *methods]
    headers += ["kalibr (paper)"] if kalibr else []
    body = []
    for row in entry["pairs"]:
        cells = [f"{row['source']} to {row['target']}", number(row["paper"])]
        cells += [_spread(row["here"]), number(row["at_truth"]["mean"])]
        cells += [f"{max(row['ratios']):.3f}"]
        cells += [_baseline(row["baselines"].get(method)) for method in methods]
        cells += [number(row["paper_kalibr"])] if kalibr else []
        body.append(cells)
    mean = entry["average"]
    last = ["average", number(mean["paper"]), _spread(mean["here"])]
    last += [number(mean["at_truth"]["mean"]), ""]
    last += [_both(mean["baselines"][m]["paper"], mean["baselines"][m]["rms"]) for m in methods]
    body.append([*last, *([""] if kalibr else [])])
    return table(headers, body) + "\n"


def _baseline(found: Optional[Mapping[str, Any]]) -> str:
    if found is None:
        return ""
    share = "" if found["solved"] == found["seeds"] else f" ({found['solved']} of {found['seeds']})"
    return _both(found["paper"], found["rms"]["mean"]) + share


def _both(paper: Optional[float], here: Optional[float]) -> str:
    """Return a cell: the paper's figure where it has one, and ours; a dash is a failure."""
    ours = "-" if here is None else number(here)
    return ours if paper is None else f"{number(paper)} / {ours}"


def _spread(values: Mapping[str, Any]) -> str:
    mean = number(values["mean"])
    return mean if len(values["values"]) < 2 else f"{mean} ± {number(values['std'])}"


def _poses(entry: Mapping[str, Any]) -> str:
    """Return the errors of the pairs' poses, but for kinds that repeat those of another table."""
    if not entry["number"]:
        return ""
    methods = _methods(entry)
    body = []
    for row in entry["pairs"]:
        known = [m for m in methods if row["baselines"].get(m, {}).get("solved")]
        if not known:
            continue
        widest = max(known, key=lambda m: row["baselines"][m]["solved"])
        of_here = row["baselines"][widest]
        cells = [f"{row['source']} to {row['target']}", _pose(of_here, "here")]
        body.append([*cells, *(_method_pose(row["baselines"].get(m)) for m in methods)])
    headers = ["pose against the truth [mm, deg]", "here", *methods]
    return table(headers, body) + "\n" if body else ""


def _method_pose(found: Optional[Mapping[str, Any]]) -> str:
    if not found or not found["solved"]:
        return ""
    times = found["off_mm"]["mean"] / found["here_mm"]["mean"]
    return f"{_pose(found, 'off')} ({number(times)} times)"


def _pose(found: Mapping[str, Any], whose: str) -> str:
    return f"{number(found[f'{whose}_mm']['mean'])}, {number(found[f'{whose}_deg']['mean'])}"


def _rigs(rows: Sequence[Mapping[str, Any]]) -> str:
    headers = [
        "method",
        "sensor",
        "off [mm]",
        "[deg]",
        "here [mm]",
        "[deg]",
        "times",
        "here nearer",
    ]
    body = [_rig_row(row) for row in rows]
    text = (
        "### Rigs put together from the baselines' pairs, against the truth\n\n"
        "Each sensor in the one that stays; *times* is the ratio of the mean errors, *here nearer* "
        "in how many of the seeds the joint calibration is.\n\n"
    )
    return text + table(headers, body) + "\n"


def _rig_row(row: Mapping[str, Any]) -> List[str]:
    figures = [row[key]["mean"] for key in ("off_mm", "off_deg", "here_mm", "here_deg")]
    nearer = f"{row['here_nearer']} of {row['seeds']}"
    return [row["method"], row["sensor"], *map(number, [*figures, row["times"]]), nearer]


def _single(rows: Sequence[Mapping[str, Any]]) -> str:
    body = [[row["sensor"], _spread(row["rms"])] for row in rows]
    text = (
        "### Cameras by themselves\n\nCorners against the board where each image's own corners put "
        "it: noise of labels and errors of intrinsics, whatever the camera's place.\n\n"
    )
    return text + table(["camera", "RMS [px]"], body) + "\n"
