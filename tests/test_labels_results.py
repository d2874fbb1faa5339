"""docs/labels.md repeats figures of `make results`: they are those of its last run."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "labels.md").read_text(encoding="utf-8")
RESULTS = json.loads((ROOT / "docs" / "results" / "results.json").read_text(encoding="utf-8"))


def measured(part, what):
    (row,) = [row for row in RESULTS[part] if re.search(what, row["what"])]
    return row["measured"]


@pytest.mark.parametrize(
    ("sensor", "what"),
    [
        ("LiDAR", r"^LiDAR: boards found"),
        ("depth", r"^depth: boards found"),
        ("RGB", r"^RGB, squares >= .*: boards found"),
    ],
)
def test_boards_found_are_those_of_the_results(sensor, what):
    told = re.findall(rf"{sensor} (\d+ of \d+)", PAGE)
    assert told
    assert set(told) == {measured("labels", what).replace(" / ", " of ")}


def test_the_floor_of_lidars_that_see_the_whole_board_is_that_of_the_results():
    mean = RESULTS["whole_board_lidar3d-lidar3d_mm"]["mean"]
    assert re.findall(r"(\d+) mm where both do", PAGE) == [f"{mean:.0f}"]


def test_the_cost_of_collecting_is_that_of_the_results():
    costs = [row["measured"] for row in RESULTS["cost"] if row["what"].startswith("train bag")]
    wall_s, processor_s = zip(*[map(int, re.findall(r"(\d+) s", cost)) for cost in costs])
    times = f"{min(wall_s)} to {max(wall_s)} s by the clock, {min(processor_s)} to "
    assert f"{times}{max(processor_s)} s of a processor" in PAGE
    large, small = re.findall(r"\d+ MB", measured("cost", r"^peak memory, 23 stops and 6 stops$"))
    assert f"{large} for 23 stops (1.4 GB), {small} for 6" in PAGE
