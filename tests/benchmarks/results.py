"""`make results`: the paper's tables, and the labels against their truth, on the simulated cell.

For each seed: a train and a test bag are simulated (kept in results_output/, 1.4 GB each, and used
again), labeled without any seed by hand, calibrated from a start 0.1 m and 0.1 rad off, evaluated
on the test set beside the baselines. A second train bag of each seed is of the rough profile, in
which sensors, board and robot err as real ones do; it is calibrated with the defaults and with
`--model_errors auto`. Writes docs/results/results.json and docs/results/README.md. A seed takes
about a quarter of an hour on two free cores. `--only` makes one part anew and keeps the others;
`--resume` takes the datasets, calibrations and evaluations that an earlier run left.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

import numpy as np
from cell_runs import PLAIN, STOPS, CellRun
from drawn_runs import drawn_part
from label_figures import Figure, found_figures, label_figures
from label_truth import Sight, sights
from paper_tables import camchain_of_truth, paper_tables, rigs_against_truth, single_cameras
from results_page import LARGEST_RATIO, page
from rough_results import ROUGH, rough_part

from atom_core.io.atomic import write_json_atomically, write_text_atomically
from atom_core.io.dataset_json import read_dataset
from atom_core.report.tables import text_table
from atom_core.synthetic.cell import SCENARIOS, statistics

ROOT = Path(__file__).resolve().parents[2]
TABLES = "tables"
DRAWN = "drawn"
PARTS = PLAIN, TABLES, DRAWN, ROUGH
SHORT_STOPS = 6
COLLECT_LIMIT_S = 90.0  # of the train bag, on two cores
WHOLE_BOARD = 0.95  # of it between a LiDAR's layers


class Row(NamedTuple):
    """A row of the paper's table: its figure, and the kind of pairs in ``evaluation.json``."""

    name: str
    kind: str
    paper: Optional[float]
    goal: Optional[float]


ROWS = (
    Row("rgb-rgb_px", "rgb-rgb", 0.563, 0.563),
    Row("lidar3d-rgb_px", "lidar3d-rgb", 2.582, 2.58),
    Row("lidar3d-depth_px", "lidar3d-depth", 1.306, 1.31),
    Row("depth-rgb_px", "depth-rgb", 3.394, 3.39),
    Row("lidar3d-lidar3d_mm", "lidar3d-lidar3d", 32.974, 33.0),
    Row("lidar3d-lidar3d_common_mm", "lidar3d-lidar3d_common", 32.974, 32.97),
    Row("lidar3d-lidar3d_plane_mm", "lidar3d-lidar3d_plane", None, None),
)


def main() -> None:
    """Run everything that is not there yet; print and write the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--work", type=Path, default=ROOT / "results_output")
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "results")
    parser.add_argument("--raw", action="store_true", help="bags without compression, 3.5 GB each")
    parser.add_argument("--only", choices=PARTS, help="this part alone, the other as it was")
    parser.add_argument("--resume", action="store_true", help="take what an earlier run left")
    args = parser.parse_args()
    document: Dict[str, Any] = {}
    if args.only:
        document = json.loads((args.output / "results.json").read_text(encoding="utf-8"))
    if args.only in (None, PLAIN):
        document.update(plain_part(args))
    if args.only in (None, TABLES):
        document[TABLES] = tables_part(args)
    if args.only in (None, DRAWN):
        document[DRAWN] = drawn_part(args.seeds)
    if args.only in (None, ROUGH):
        document[ROUGH] = rough_part(args.seeds, args.work, not args.raw, args.resume)
    args.output.mkdir(parents=True, exist_ok=True)
    write_json_atomically(args.output / "results.json", document, indent=1)
    write_text_atomically(args.output / "README.md", page(document))
    _show(document)


def plain_part(args: argparse.Namespace) -> Dict[str, Any]:
    """Return the tables of the plain profile: sensors with noise alone."""
    runs = _runs(args)
    seen = {
        (run.seed, name): _carried_out(run, name, args.resume) for run in runs for name in STOPS
    }
    documents = [_evaluated(run, args.resume) for run in runs]
    every = [sight for some in seen.values() for sight in some]
    return {
        "rows": table(documents, args.seeds),
        "whole_board_lidar3d-lidar3d_mm": whole_board(documents, runs, seen),
        "pairs": _texts([_worst_pair(documents)]),
        "labels": _texts(label_figures(every) + _found(runs, seen)),
        "cost": _texts(cost(runs, args.work, not args.raw)),
        "made": _made(args),
    }


def tables_part(args: argparse.Namespace) -> Dict[str, Any]:
    """Return the paper's tables pair by pair, beside the baselines; takes what is there already."""
    runs = _runs(args)
    for run in runs:
        for name in STOPS:
            run.simulate(name, STOPS[name])
            if not run.dataset(name).is_file():
                run.collect(name)
    documents = [_evaluated(run, resume=True) for run in runs]
    return {
        "table_1": _table_1(runs),
        "tables": paper_tables(documents),
        "rigs": rigs_against_truth(documents),
        "single_cameras": single_cameras(documents),
        "camchain_of_truth_px": camchain_of_truth(documents),
        "seeds": list(args.seeds),
        "made": _made(args),
    }


def _runs(args: argparse.Namespace) -> List[CellRun]:
    return [CellRun(seed, args.work / f"seed_{seed}", not args.raw) for seed in args.seeds]


def _evaluated(run: CellRun, resume: bool) -> Dict[str, Any]:
    if not (resume and (run.evaluation / "evaluation.json").is_file()):
        run.calibrate()
        run.evaluate()
    return run.evaluation_document()


def _made(args: argparse.Namespace) -> Dict[str, Any]:
    """Return when and where results were made."""
    return {
        "date": time.strftime("%Y-%m-%d"),
        "cores": os.cpu_count(),
        "compressed": not args.raw,
    }


def _carried_out(run: CellRun, scenario: str, resume: bool) -> List[Sight]:
    run.simulate(scenario, STOPS[scenario])
    if not (resume and run.dataset(scenario).is_file()):
        run.collect(scenario)
    return sights(run.dataset(scenario), run.truth(scenario), run.labels(scenario))


def table(documents: Sequence[Dict[str, Any]], seeds: Sequence[int]) -> Dict[str, Any]:
    """Return the paper's table: mean and standard deviation over the seeds."""
    rows = {}
    for row in ROWS:
        averages = [document["averages"][row.kind] for document in documents]
        rows[row.name] = _row(
            row.paper, [a["rms"] for a in averages], seeds, [a["at_truth"] for a in averages]
        )
    means = [document["ground_truth"]["mean"] for document in documents]
    rows["pose_mm"] = _row(None, [1e3 * mean["translation_error_m"] for mean in means], seeds)
    rows["pose_deg"] = _row(None, [mean["rotation_error_deg"] for mean in means], seeds)
    return rows


def _row(
    paper: Optional[float],
    values: Sequence[float],
    seeds: Sequence[int],
    at_truth: Optional[Sequence[float]] = None,
) -> Dict[str, Any]:
    return {
        "paper": paper,
        "mean": float(np.mean(values)),
        "std": float(np.std(values)),
        "at_truth": None if at_truth is None else float(np.mean(at_truth)),
        "seeds": list(seeds),
        "values": [float(value) for value in values],
    }


def whole_board(
    documents: Sequence[Dict[str, Any]], runs: Sequence[CellRun], seen: Dict[Any, List[Sight]]
) -> Dict[str, float]:
    """Return LiDAR-LiDAR over the collections in which both see the whole board."""
    rms, everything = [], 0
    for document, run in zip(documents, runs):
        share = {s.key[:2]: s.in_view for s in seen[(run.seed, "test")]}
        for pair in document["pairs"]:
            if pair["kind"] != "lidar3d-lidar3d" or pair.get("reverse") or pair["skipped"]:
                continue
            for key, figures in pair["per_collection"].items():
                both = min(share[(key, pair["source"])], share[(key, pair["target"])])
                everything += 1
                if both >= WHOLE_BOARD:
                    rms.append(figures["rms"])
    mean = float(np.mean(rms)) if rms else float("nan")
    return {"mean": mean, "detection_pairs": len(rms), "of": everything}


def _worst_pair(documents: Sequence[Dict[str, Any]]) -> Figure:
    """Return the pair whose figure exceeds that of the true edges most."""
    worst = ("", 0.0)
    for document in documents:
        for pair in document["pairs"]:
            if not pair["skipped"] and pair["at_truth"]:
                ratio = pair["rms"] / pair["at_truth"]["rms"]
                name = f"{pair['source']} to {pair['target']}, {pair['kind']}"
                worst = max(worst, (name, ratio), key=lambda item: item[1])
    return Figure(
        f"largest ratio of any pair, in either direction and of any metric ({worst[0]})",
        f"{worst[1]:.3f}",
        f"<= {LARGEST_RATIO}",
        worst[1] <= LARGEST_RATIO,
    )


def _found(runs: Sequence[CellRun], seen: Dict[Any, List[Sight]]) -> List[Figure]:
    figures = []
    for name in STOPS:
        figures += found_figures([s for run in runs for s in seen[(run.seed, name)]], name)
    for row in _table_1(runs):
        share = float(np.mean(row["here"])) / row["paper"]
        figures.append(
            Figure(
                f"{row['set']}: {row['what']} by seed / the paper's",
                f"{row['here']} / {row['paper']}",
                "0.8 to 1.2",
                0.8 <= share <= 1.2,
            )
        )
    return figures


def _table_1(runs: Sequence[CellRun]) -> List[Dict[str, Any]]:
    """Return the paper's Table 1: what its datasets hold, and ours by seed."""
    rows = []
    for name in STOPS:
        counts = [statistics(read_dataset(run.dataset(name))) for run in runs]
        for what in ("collections", "complete", "partial"):
            here = [int(getattr(count, what)) for count in counts]
            row = {"set": name, "what": what, "paper": getattr(SCENARIOS[name], what), "here": here}
            rows.append(row)
    return rows


def cost(runs: Sequence[CellRun], work: Path, compressed: bool) -> List[Figure]:
    """Return what labeling a bag costs, and whether its length matters for memory."""
    short = CellRun(runs[0].seed, work / "short", compressed)
    short.simulate("train", SHORT_STOPS)
    if "collect_train" not in short.costs:
        short.collect("train")
    figures, load = [], os.getloadavg()[1]
    for run in runs:
        spent = run.costs["collect_train"]
        # On a free machine it takes no longer than its processor time: a core is always busy.
        least_s = min(spent.wall_s, spent.cpu_s)
        figures.append(
            Figure(
                f"train bag of seed {run.seed} to dataset: wall clock, processor time",
                f"{spent.wall_s:.0f} s, {spent.cpu_s:.0f} s (load about {load:.0f})",
                f"<= {COLLECT_LIMIT_S:.0f} s on two free cores",
                least_s <= COLLECT_LIMIT_S,
            )
        )
    long_mb, short_mb = runs[0].costs["collect_train"].peak_mb, short.costs["collect_train"].peak_mb
    figures.append(
        Figure(
            f"peak memory, {STOPS['train']} stops and {SHORT_STOPS} stops",
            f"{long_mb:.0f} MB, {short_mb:.0f} MB",
            "the same to 10 %",
            long_mb <= 1.1 * short_mb,
        )
    )
    return figures


def _texts(figures: Sequence[Figure]) -> List[Dict[str, Any]]:
    return [
        {**figure._asdict(), "reached": None if figure.reached is None else bool(figure.reached)}
        for figure in figures
    ]


def _show(document: Dict[str, Any]) -> None:
    rows = [
        [name, row["paper"], row["mean"], row["std"], row["at_truth"]]
        for name, row in document["rows"].items()
    ]
    print(text_table(["", "paper", "mean", "std", "at truth"], rows, digits=3))
    print(json.dumps(document["whole_board_lidar3d-lidar3d_mm"]))
    print(json.dumps(document["rough"]["rows"], indent=1))
    for part in ("pairs", "labels", "cost"):
        figures = [[f["what"], f["measured"], f["goal"], f["reached"]] for f in document[part]]
        print("\n" + text_table(["", "measured", "goal", "reached"], figures))


if __name__ == "__main__":
    main()
