"""How time and memory grow with sensors and collections; part of `make bench`.

Every measurement is a process of its own (measure.py). Writes scaling.csv and scaling.png.
"""

from __future__ import annotations

import csv
import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

import matplotlib
from rigs import rig_dataset

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.report.tables import text_table
from atom_core.synthetic import Noise, paper_cell

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 (after the choice of the backend)

Row = Dict[str, Any]
Size = Tuple[int, int]
SIZES: Tuple[Size, ...] = ((7, 23), (7, 100), (7, 400), (20, 200), (50, 500))
QUICK = SIZES[:2]
_LARGEST = SIZES[-1]  # minutes for scipy and for the plain program: left out, and said
_REPEATS = {(7, 23): 5, (7, 100): 3}
STEPS = ("load_s", "build_s", "initialise_s", "solve_s", "covariance_s")
COLUMNS = (
    "sensors",
    "collections",
    "solver",
    "weights",
    "loss",
    "detections",
    "rows",
    "parameters",
    "status",
    "iterations",
    *STEPS,
    "peak_mb",
    "cost",
    "plain_s",
    "plain_iterations",
    "plain_cost",
    "atom_none_s",
    "atom_none_cost",
    "checked_s",
)


def scaling(output: Path, quick: bool = False, everything: bool = False) -> List[Row]:
    """Measure all sizes and write table and plot.

    Args:
        output: folder for the results and for the plain program.
        quick: only the two smallest sizes.
        everything: scipy and the plain program for the largest size, too.
    """
    rows: List[Row] = []
    with tempfile.TemporaryDirectory(dir=output) as folder:
        for size in QUICK if quick else SIZES:
            rows += _measured(size, Path(folder), output, everything or size != _LARGEST)
    with (output / "scaling.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    print(_table(rows))
    plot(rows, output / "scaling.png")
    return rows


def _measured(size: Size, folder: Path, output: Path, all_solvers: bool) -> List[Row]:
    sensors, collections = size
    path = folder / "dataset.pickle"
    began = time.perf_counter()
    path.write_bytes(pickle.dumps(rig_dataset(sensors, collections), protocol=5))
    print(f"{sensors}x{collections}: dataset made in {time.perf_counter() - began:.0f} s")
    repeat = ["--repeat", str(_REPEATS.get(size, 1))]
    rows = [_run(path, size, "ceres", repeat)]
    if all_solvers:
        rows.append(_run(path, size, "scipy", ["--repeat", "1"]))
        compared = _run(path, size, "ceres", [*repeat, "--plain", str(output)])
        rows[0].update({k: v for k, v in compared.items() if k.startswith(("plain", "atom_none"))})
        for name in ("solve_s", "checked_s"):  # in turns with the plain program
            rows[0][name] = compared[name]
    else:
        print(f"{sensors}x{collections}: scipy and the plain program are left out (--everything)")
    return rows


def _run(path: Path, size: Size, solver: str, more: Sequence[str]) -> Row:
    program = Path(__file__).with_name("measure.py")
    command = [sys.executable, str(program), str(path), "--solver", solver, *more]
    # As in the commands, where atom_core is loaded before numpy and sees to it.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    ended = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=environment)
    printed = ended.stdout
    row: Row = {"sensors": size[0], "collections": size[1], "solver": solver}
    return {**row, "weights": "sigma", "loss": "cauchy", **json.loads(printed.splitlines()[-1])}


def _table(rows: List[Row]) -> str:
    shown = (
        "rows",
        "parameters",
        "iterations",
        *STEPS,
        "peak_mb",
        "plain_s",
        "atom_none_s",
        "checked_s",
    )
    body = [
        [f"{row['sensors']}x{row['collections']}", row["solver"], *(row.get(c) for c in shown)]
        for row in rows
    ]
    return text_table(["size", "solver", *shown], body, "Growth (sigma weights, cauchy)", 3)


def comparable(row: Row) -> bool:
    """Tell whether the plain program ended within 1 % of our cost."""
    if row.get("plain_cost") is None:
        return False
    return abs(row["plain_cost"] / row["atom_none_cost"] - 1.0) <= 0.01


def find(rows: List[Row], size: Size, solver: str = "ceres") -> Optional[Row]:
    """Return the row of a size and a solver."""
    found = [r for r in rows if (r["sensors"], r["collections"]) == size and r["solver"] == solver]
    return found[0] if found else None


def command_seconds(output: Path, *words: str, repeat: int = 3) -> Tuple[float, float]:
    """Return how long `calibrate` takes for the paper's cell: by the clock, and of cores.

    The best of some runs. On a busy machine the second says more.

    Args:
        output: folder for files that are removed again.
        words: further options.
        repeat: number of runs.
    """
    with tempfile.TemporaryDirectory(dir=output) as folder:
        scene = paper_cell(0, "train", Noise(), (0.1, 0.1))
        dataset = write_dataset_folder(scene.dataset, Path(folder) / "data", name="cell")
        clock, cores = [], []
        for _ in range(repeat):
            began, before = time.perf_counter(), os.times()
            subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "atom_core",
                    "calibrate",
                    "--dataset",
                    str(dataset),
                    "--output",
                    f"{folder}/out",
                    "--overwrite",
                    *words,
                ],
                check=True,
                stdout=subprocess.DEVNULL,
            )
            after = os.times()
            clock.append(time.perf_counter() - began)
            cores.append(
                after.children_user
                + after.children_system
                - before.children_user
                - before.children_system
            )
    return min(clock), min(cores)


def plot(rows: List[Row], path: Path) -> None:
    """Draw time and memory over rows, and where the time goes."""
    figure, (times, memory, split) = plt.subplots(1, 3, figsize=(15, 4.6))
    lines = (
        ("ceres", "solve_s", "ceres, default options", "o-"),
        ("ceres", "atom_none_s", "ceres, --weights atom --loss none", "s--"),
        ("ceres", "plain_s", "plain Ceres program", "^:"),
        ("scipy", "solve_s", "scipy, default options", "d-."),
    )
    for solver, key, label, style in lines:
        mine = [
            (r["rows"], r[key])
            for r in rows
            if r["solver"] == solver and r.get(key) and (key != "plain_s" or comparable(r))
        ]
        if mine:
            times.loglog(*zip(*sorted(mine)), style, label=label)
    times.set(xlabel="residual rows", ylabel="solve [s]", title="Time to solve")
    times.legend()
    for solver, style in (("ceres", "o-"), ("scipy", "d-.")):
        mine = [(r["rows"], r["peak_mb"]) for r in rows if r["solver"] == solver and r["peak_mb"]]
        memory.loglog(*zip(*sorted(mine)), style, label=solver)
    memory.set(xlabel="residual rows", ylabel="MB", title="Peak memory of the process")
    memory.legend()
    ours = [r for r in rows if r["solver"] == "ceres"]
    labels = [f"{r['sensors']}x{r['collections']}" for r in ours]
    for row, label in zip(ours, labels):
        for axes, value in ((times, row["solve_s"]), (memory, row["peak_mb"])):
            axes.annotate(
                label,
                (row["rows"], value),
                (0, 6),
                textcoords="offset points",
                ha="right",
                fontsize=8,
            )
    base = [0.0] * len(ours)
    for step in STEPS:
        share = [100.0 * r[step] / sum(r[s] for s in STEPS) for r in ours]
        split.bar(labels, share, bottom=base, label=step[:-2])
        base = [b + s for b, s in zip(base, share)]
    split.set(xlabel="sensors x collections", ylabel="%", title="Where the time goes (ceres)")
    split.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axes in (times, memory):
        axes.grid(alpha=0.3, which="both")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)
