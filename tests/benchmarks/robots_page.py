"""The page docs/results/robots.md from the runs that bench_robots.py has written down."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Sequence

COLUMNS = (
    *("camera mm", "camera deg", "range mm", "range deg"),
    *("edge mm", "edge deg", "joint deg", "joint mm"),
)
LIMITS = dict(zip(COLUMNS, (1.0, 0.05, 1.0, 0.05, 1.0, 0.05, 0.02, 1.0)))
AT_WORK = dict(zip(COLUMNS, (0.5, 0.02, 1.5, math.inf, 0.5, 0.02, 0.02, 1.0)))
LIMITS_OF = {"collab_cell_at_work": AT_WORK}
CONVERGED = "converged"

HEAD = """# The example robots against the truth

Written by `python3 tests/benchmarks/bench_robots.py --keep docs/results`; do not edit. A run is the
whole way of a robot and a seed: simulated bag, labels, calibration from 0.1 m and 0.1 rad off. A
figure is the largest error of a run. Sensors are compared relative to the reference, or by their
own edge where the world is known; *edge* are estimated edges without a sensor; *joint* are joints
that the data tell, those apart that a prior holds. Limits: {limits}; the cell at work:
{at_work}.
"""


def page(runs: Sequence[Mapping[str, Any]]) -> str:
    """Return the page of all runs that were written down."""
    names = list(dict.fromkeys(run["robot"] for run in runs))
    parts = [HEAD.format(limits=_limits(LIMITS), at_work=_limits(AT_WORK))]
    parts.append("## The largest error of all seeds\n")
    rows = [_of_robot(name, [r for r in runs if r["robot"] == name]) for name in names]
    parts.append(_table(["robot", "seeds", *COLUMNS, "within the limits"], rows))
    parts.append("## Every run\n")
    headers = ["robot", "seed", *COLUMNS, "status", "commit", "date"]
    parts.append(_table(headers, [_of_run(run) for run in runs]))
    return "\n".join(parts)


def within_limits(run: Mapping[str, Any]) -> bool:
    """Say whether a run converged with every error within the limits of its robot."""
    limits = LIMITS_OF.get(run["robot"], LIMITS)
    within = all(value <= limits[name] for name, value in run["largest"].items())
    return within and run["status"] == CONVERGED


def largest_of(runs: Sequence[Mapping[str, Any]]) -> Dict[str, List[float]]:
    """Return the runs' errors by column."""
    return {c: [r["largest"][c] for r in runs if c in r["largest"]] for c in COLUMNS}


def _of_robot(name: str, runs: Sequence[Mapping[str, Any]]) -> List[str]:
    shown = [_cell(max(values)) if values else "" for values in largest_of(runs).values()]
    good = sum(within_limits(run) for run in runs)
    seeds = ", ".join(str(run["seed"]) for run in runs)
    return [name, seeds, *shown, f"{good} of {len(runs)}"]


def _of_run(run: Mapping[str, Any]) -> List[str]:
    shown = [_cell(run["largest"][c]) if c in run["largest"] else "" for c in COLUMNS]
    end = [run["status"], run["commit"], run["date"]]
    return [run["robot"], str(run["seed"]), *shown, *end]


def _limits(limits: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {limit:g}" for name, limit in limits.items() if limit < math.inf)


def _cell(value: float) -> str:
    return f"{value:.4f}" if value < 0.1 else f"{value:.2f}"


def _table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines: List[Sequence[str]] = [headers, ["---"] * len(headers), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"
