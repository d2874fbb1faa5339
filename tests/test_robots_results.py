"""docs/results/robots.md is the page of the runs in robots.json, and says which are too far off."""

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
sys.path.insert(0, str(ROOT / "tests" / "benchmarks"))

from robots_page import LIMITS, page, within_limits  # noqa: E402

RUNS = json.loads((RESULTS / "robots.json").read_text(encoding="utf-8"))


def test_the_page_is_that_of_the_runs():
    assert (RESULTS / "robots.md").read_text(encoding="utf-8") == page(RUNS)


@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"{run['robot']} {run['seed']}")
def test_a_run_that_was_written_down_is_within_its_limits(run):
    assert run["largest"]
    assert within_limits(run)


def rows_of_the_readme():
    """Return the robots of each row of errors, and its figures [mm, deg] by kind."""
    text = (ROOT / "atom_examples" / "README.md").read_text(encoding="utf-8")
    table = text.split("| robots | seeds |")[1].split("\n\n")[0]
    rows = []
    for line in table.splitlines()[2:]:
        names, _, *cells = [cell.strip() for cell in line.strip("|").split("|")]
        figures = {
            f"{kind} {unit}": number
            for kind, cell in zip(("camera", "range", "joint"), cells)
            for number, unit in re.findall(r"([\d.]+) (mm|deg)", cell)
        }
        rows.append((names.split(":")[0].split(", "), figures))
    return rows


def largest(robots, figure):
    return max(run["largest"].get(figure, 0.0) for run in RUNS if run["robot"] in robots)


def test_the_figures_of_the_readme_are_the_largest_of_the_runs_rounded_up():
    rows = rows_of_the_readme()
    assert {name for robots, _ in rows for name in robots} == {run["robot"] for run in RUNS}
    for robots, figures in rows:
        assert figures
        for figure, shown in figures.items():
            step = 10.0 ** -len(shown.partition(".")[2])
            error = largest(robots, figure)
            assert error <= float(shown) < error + step, (robots, figure, error)


def test_a_run_is_judged_by_its_errors_and_its_status():
    run = {"robot": "rrbot", "seed": 0, "largest": {"camera mm": 0.9}, "status": "converged"}
    assert within_limits(run)
    assert not within_limits({**run, "largest": {"camera mm": LIMITS["camera mm"] + 0.01}})
    assert not within_limits({**run, "status": "rank_deficient"})
    at_work = {**run, "robot": "collab_cell_at_work", "largest": {"range mm": 1.4}}
    assert within_limits(at_work)
    assert not within_limits({**at_work, "largest": {"camera mm": 0.9}})
