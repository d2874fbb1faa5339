"""docs/results/README.md out of results.json."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, Optional, Sequence

from markdown_tables import number, table
from paper_tables_page import drawn_part_page, paper_tables_part

LARGEST_RATIO = 1.05  # of a pair to the same pair at the truth
_NAMES = {
    "rgb-rgb_px": "RGB-RGB, RMS [px]",
    "lidar3d-rgb_px": "LiDAR-RGB, RMS [px]",
    "lidar3d-depth_px": "LiDAR-depth, RMS [px]",
    "depth-rgb_px": "depth-RGB, RMS [px]",
    "lidar3d-lidar3d_mm": "LiDAR-LiDAR, nearest points, RMS [mm]",
    "lidar3d-lidar3d_common_mm": "LiDAR-LiDAR, the same over the part that both see, RMS [mm]",
    "lidar3d-lidar3d_plane_mm": "LiDAR-LiDAR, points to plane, RMS [mm]",
    "pose_mm": "pose against the truth, mean of six sensors [mm]",
    "pose_deg": "pose against the truth, mean of six sensors [deg]",
}
_MODES = {"suggest": "defaults", "auto": "`--model_errors auto`"}
_HEAD = """# Results on the simulated cell

Written by `make results`; do not edit. What is measured, and how: [evaluation](../evaluation.md),
[labels](../labels.md). Everything comes out of simulated bags: 23 stops of the board to calibrate
with, 17 others to evaluate on; range sensors are labeled without a seed by hand; every free sensor
starts 0.1 m and 0.1 rad off.
"""


def page(document: Mapping[str, Any]) -> str:
    """Return the page as Markdown."""
    rows = document["rows"]
    made = document["made"]
    seeds = ", ".join(str(seed) for seed in rows["rgb-rgb_px"]["seeds"])
    bags = "compressed" if made["compressed"] else "raw"
    parts = [
        _HEAD,
        f"Seeds {seeds}; {bags} bags; {made['date']}, {made['cores']} cores.\n",
        "## The paper's averages\n",
        "*At the truth* is the same metric on the same labels with the true edges: the floor that "
        "labels, noise and metric set. The paper's figures are those of its own simulated cell.\n",
        table(
            ["", "paper", "here, mean", "std over seeds", "at the truth"],
            [
                [name, *(number(rows[key][k]) for k in ("paper", "mean", "std", "at_truth"))]
                for key, name in _NAMES.items()
                if key in rows  # results of before a row was added lack it
            ],
        ),
        _whole_board(document["whole_board_lidar3d-lidar3d_mm"]),
        _figures(_worst_of_tables(document.get("tables")) + document["pairs"]),
        paper_tables_part(document["tables"]) if "tables" in document else "",
        drawn_part_page(document["drawn"]) if "drawn" in document else "",
        _rough(document["rough"]),
        "\n## Labels against their truth\n",
        _figures(document["labels"]),
        "\n## Cost of `collect_from_bag`\n",
        "Where other programs held the cores, the processor time is judged; on free cores the "
        "clock shows no more than that, apart from waiting for the disk.\n",
        _figures(document["cost"]),
    ]
    return "\n".join(parts) + "\n"


def _worst_of_tables(part: Optional[Mapping[str, Any]]) -> List[Dict[str, Any]]:
    """Return the pair of the paper's tables that exceeds its floor most, in any of the seeds."""
    if part is None:
        return []
    pairs = [
        (table, pair) for table in part["tables"] if table["number"] for pair in table["pairs"]
    ]
    table, pair = max(pairs, key=lambda both: max(both[1]["ratios"]))
    ratio = max(pair["ratios"])
    where = f"Table {table['number']}, {pair['source']} to {pair['target']}"
    return [
        {
            "what": f"largest ratio of a pair of the paper's tables to its floor ({where})",
            "measured": f"{ratio:.3f}",
            "goal": f"<= {LARGEST_RATIO}",
            "reached": ratio <= LARGEST_RATIO,
        }
    ]


def _whole_board(found: Dict[str, float]) -> str:
    return (
        f"\nNearest points of two LiDARs are far apart where one of them sees only a strip of the "
        f"board. Over the {found['detection_pairs']:.0f} of {found['of']:.0f} pairs of detections "
        f"in which both see all of it, the LiDAR-LiDAR figure is {found['mean']:.1f} mm.\n"
    )


_ROUGH = """
## With the errors of real sensors

The same cell recorded with `--realism rough`: LiDARs read long or short, the depth camera has
waves, intrinsics, board and robot are a little wrong, pictures are blurred
([figures](../../atom_examples/README.md#the-rough-profile)). Labeled and calibrated as above, with
the defaults and with `--model_errors auto`, against the truth. *Largest* is the largest of the 36
numbers of the six poses in its stated sigma; *within 95 %* is the share of them that their interval
holds.
"""


def _rough(part: Mapping[str, Any]) -> str:
    rows = part["rows"]
    body = table(
        ["seed", "", "mean [mm]", "mean [deg]", "farthest", "largest", "within 95 %", "said"],
        [
            [
                str(row["seed"]),
                _MODES[row["model_errors"]],
                *(number(row[key]) for key in ("mean_mm", "mean_deg")),
                f"{row['farthest']}, {row['farthest_mm']:.1f} mm",
                f"{row['largest_in_sigmas']:.1f} sigma",
                f"{100.0 * row['within_95_percent']:.0f} %",
                f"{row['status']}: {row['said'].split('; look at')[0]}",
            ]
            for row in rows
        ],
    )
    seeds = ", ".join(dict.fromkeys(str(row["seed"]) for row in rows))
    made = part["made"]
    return f"{_ROUGH}\nSeeds {seeds}; {made['date']}, {made['cores']} cores.\n\n{body}\n"


def _figures(figures: Sequence[Mapping[str, Any]]) -> str:
    marks = {True: "yes", False: "**no**", None: ""}
    return table(
        ["", "measured", "goal", "reached"],
        [[f["what"], f["measured"], f["goal"], marks[f["reached"]]] for f in figures],
    )
