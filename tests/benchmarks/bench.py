"""`make bench`: speed, growth and accuracy of the solvers; frames of RViz; labels after a seed
and a correction; what a calibration says of planted faults.

Prints tables and writes bench_output/*.csv (speed, scaling, accuracy, starts, convergence,
gross_errors, rviz, leaving_out, seeds, corrected_labels, trust, planted, rough) and scaling.png;
docs/benchmarks/README.md tells how to read them. Times depend on the machine and its load: compare
the rows of one run with each other. The references beside our solvers, on the same rows from the
same start: plain_ceres.cpp (a straightforward Ceres program, one thread) and
scipy.optimize.least_squares (trf, sparse analytic Jacobian, lsmr).
"""

from __future__ import annotations

import argparse
import csv
import shutil
import signal
import time
from pathlib import Path
from typing import Callable, Dict

import numpy as np
from convergence import convergence
from model_errors import model_errors
from plain_ceres import PlainCeres
from rviz_rate import rviz_rates
from scaling import command_seconds, comparable, find, scaling
from scipy.optimize import least_squares
from trust import trust

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.commands.progress import watched
from atom_core.editing.left_out import LeftOut
from atom_core.evaluation.ground_truth import ground_truth_errors
from atom_core.model.dataset import Dataset, pose
from atom_core.problem.builder import build_problem
from atom_core.problem.measurements import read_measurements
from atom_core.problem.problem import Problem
from atom_core.report.tables import text_table
from atom_core.solvers.base import CONVERGED, SolverOptions
from atom_core.solvers.choice import SOLVERS
from atom_core.solvers.losses import NONE
from atom_core.synthetic import Noise, paper_cell

DISTURBANCE = (0.1, 0.1)
LIMITS = {
    "solve_s": 3.0,
    "mean_mm": 1.0,
    "mean_deg": 0.035,
    "worst_mm": 2.5,
    "spread_mm": 1e-3,
    "gross_ratio": 1.5,
}


def main() -> None:
    """Run all benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("bench_output"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--quick", action="store_true", help="small sizes and few seeds")
    parser.add_argument(
        "--everything", action="store_true", help="all solvers for the largest size, too"
    )
    parser.add_argument("--only", choices=list(PARTS), action="append", help="some parts only")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="copy table and plot of the growth there"
    )
    args = parser.parse_args()
    # Background jobs of a shell ignore Ctrl-C, and so would the programs that are started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    args.output.mkdir(parents=True, exist_ok=True)
    for name in args.only or PARTS:
        PARTS[name](args)


def growth(args: argparse.Namespace) -> None:
    """Measure how time and memory grow, and judge them."""
    rows = scaling(args.output, args.quick, args.everything)
    small, large = find(rows, (7, 23)), find(rows, (50, 500))
    for row in (small, find(rows, (7, 100))):
        if row is None or not comparable(row):
            print("the plain program did not end within 1 % of our cost: no comparison")
            continue
        size = f"{row['sensors']}x{row['collections']}"
        _verdict(
            f"{size}, atom none over plain Ceres", row["atom_none_s"] / row["plain_s"], 0.25, "x"
        )
        if row is small:
            _verdict(
                f"{size}, defaults over plain Ceres", row["solve_s"] / row["plain_s"], 0.8, "x"
            )
            checked = row["checked_s"] / row["plain_s"]
            _verdict(f"{size}, defaults with sigmas and checks over plain Ceres", checked, 0.5, "x")
    if small:
        _verdict("7x23, peak memory", small["peak_mb"], 200, "MB")
    clock, cores = command_seconds(args.output, "--no_report")
    _verdict("7x23, the whole command, without its report", clock, 1.5, "s")
    print(f"of which {cores:.2f} s of work; the rest is waiting for a busy machine")
    clock, _ = command_seconds(args.output, repeat=1)
    _verdict("7x23, the whole command, with its report", clock, 20.0, "s")
    hundred, four_hundred = find(rows, (7, 100)), find(rows, (7, 400))
    if hundred and four_hundred:
        ratio = four_hundred["solve_s"] / hundred["solve_s"]
        _verdict("solve 7x400 over 7x100", ratio, 5, "x")
    if large:
        _verdict("50x500, solve", large["solve_s"], 30, "s")
        _verdict("50x500, peak memory", large["peak_mb"], 2000, "MB")
    print()
    if args.keep:
        args.keep.mkdir(parents=True, exist_ok=True)
        for name in ("scaling.csv", "scaling.png"):
            shutil.copy(args.output / name, args.keep / name)


def speed(output: Path) -> None:
    """Solve the paper's cell with each solver and set of options, five times."""
    dataset = paper_cell(0, "train", Noise(), DISTURBANCE).dataset
    rows = []
    for name in ("ceres", "scipy"):
        for weights, loss in (("sigma", "cauchy"), ("sigma", "none"), ("atom", "none")):
            solver = SolverOptions(weights=weights, loss=loss)
            options = CalibrationOptions(solver=solver, solver_name=name)
            runs = [calibrate(dataset, options) for _ in range(5)]
            seconds = [run.seconds["solve"] for run in runs]
            last = runs[-1]
            rows.append(
                [
                    f"{name} {weights} {loss}",
                    last.problem.row_count,
                    last.problem.parameters.size,
                    last.summary.iterations,
                    min(seconds),
                    float(np.median(seconds)),
                    float(sum(last.seconds.values())),
                ]
            )
    references = _one_round(dataset, output)
    headers = [
        "solver",
        "rows",
        "parameters",
        "iterations",
        "solve best [s]",
        "solve median [s]",
        "whole [s]",
    ]
    table = rows + references
    _report(output / "speed.csv", headers, table, "Speed, 7 sensors x 23 collections", 4)
    median = {row[0]: row[5] for row in table}
    _verdict("scipy solve, default options", median["scipy sigma cauchy"], LIMITS["solve_s"], "s")
    print()


def _one_round(dataset: Dataset, output: Path) -> list:
    """Minimise the same cost from the same start by ours and by the references."""
    free = free_edges(dataset, CalibrationOptions())
    measurements = [m.with_atom_residuals() for m in read_measurements(dataset)[0]]
    boards = initial_boards(dataset, measurements, free)
    problem = build_problem(dataset, measurements, boards, free)
    sigmas = problem.initial_sigmas
    start = np.zeros(problem.parameters.size)
    rows, costs = [], {}
    for name, make_solver in SOLVERS.items():
        began = time.perf_counter()
        end = make_solver(problem).minimise(start, sigmas, NONE, 200)
        rows.append([f"one round, {name}", end.iterations, time.perf_counter() - began])
        costs[name] = end.cost
    program = PlainCeres(output)
    data = program.write(problem, sigmas)
    plain = program.run(data)
    data.unlink()
    rows.append(["one round, plain Ceres program", plain.iterations, plain.seconds])
    costs["plain Ceres program"] = plain.cost
    began = time.perf_counter()
    theirs = least_squares(
        lambda x: _stacked(problem, x, sigmas),
        start,
        jac=lambda x: problem.jacobian(x, sigmas),
        method="trf",
        x_scale="jac",
        tr_solver="lsmr",
        ftol=1e-8,
        xtol=1e-8,
        gtol=1e-8,
    )
    rows.append(["one round, least_squares", theirs.nfev, time.perf_counter() - began])
    costs["least_squares"] = theirs.cost
    print("cost: " + ", ".join(f"{name} {cost:.3f}" for name, cost in costs.items()))
    if plain.cost > 1.01 * costs["ceres"] or plain.cost < 0.99 * costs["ceres"]:
        print("the plain program did not end within 1 % of our cost: no comparison")
    size = [problem.row_count, problem.parameters.size]
    return [[name, *size, iterations, seconds, seconds, None] for name, iterations, seconds in rows]


def _stacked(problem: Problem, x: np.ndarray, sigmas: tuple) -> np.ndarray:
    pairs = zip(problem.residuals(x), sigmas)
    return np.concatenate([(r / s[:, None]).ravel() for r, s in pairs])


def accuracy(output: Path, seeds: int) -> None:
    """Calibrate the cell of every seed from a disturbed start and compare with the truth."""
    rows = []
    for seed in watched(range(seeds), seeds, "accuracy", "cells"):
        rows.append([seed, *_errors(seed, 0.0)])
    headers = ["seed", "status", "mean [mm]", "mean [deg]", "worst [mm]", "worst [deg]"]
    _report(output / "accuracy.csv", headers, rows, "Errors against truth", 3)
    print(f"converged: {sum(r[1] == 'converged' for r in rows)} of {len(rows)}")
    _verdict("mean sensor error, worst seed", max(r[2] for r in rows), LIMITS["mean_mm"], "mm")
    _verdict("mean sensor error, worst seed", max(r[3] for r in rows), LIMITS["mean_deg"], "deg")
    _verdict("worst sensor of all seeds", max(r[4] for r in rows), LIMITS["worst_mm"], "mm")
    mean_mm, mean_deg = (float(np.mean([r[i] for r in rows])) for i in (2, 3))
    print(f"mean over seeds: {mean_mm:.3f} mm, {mean_deg:.4f} deg\n")


def _errors(seed: int, gross_fraction: float) -> list:
    scene = paper_cell(seed, "train", Noise(gross_fraction=gross_fraction), DISTURBANCE)
    result = calibrate(scene.dataset)
    errors = ground_truth_errors(result.dataset, scene.truth)
    sensors = errors.sensors.values()
    return [
        result.status,
        1e3 * errors.mean.translation_m,
        errors.mean.rotation_deg,
        1e3 * max(error.translation_m for error in sensors),
        max(error.rotation_deg for error in sensors),
    ]


def starts(output: Path, cells: int) -> None:
    """Calibrate the same data from six starts, cell by cell; the answers must be one."""
    rows = []
    for cell in watched(range(cells), cells, "starts", "cells"):
        dataset = paper_cell(cell).dataset
        found, results = [], []
        for seed in range(6):
            options = CalibrationOptions(noisy_initial_guess=DISTURBANCE, seed=seed)
            results.append(calibrate(dataset, options))
            collection = next(iter(results[-1].dataset.collections.values()))
            found.append(
                [
                    pose(collection, dataset.graph, dataset.world, s.frame)[:3, 3]
                    for s in dataset.sensors.values()
                ]
            )
        converged = sum(r.status == CONVERGED for r in results)
        iterations = [r.summary.iterations for r in results]
        apart_mm = 1e3 * float(np.max(np.ptp(found, axis=0)))
        rows.append([cell, converged, min(iterations), max(iterations), apart_mm])
    headers = ["cell", "converged of 6", "fewest iterations", "most iterations", "apart [mm]"]
    _report(output / "starts.csv", headers, rows, "Same data from six starts", 7)
    print(f"converged: {sum(r[1] for r in rows)} of {6 * len(rows)}")
    _verdict("positions differ by", max(r[4] for r in rows), LIMITS["spread_mm"], "mm")
    print()


def gross_errors(output: Path, seeds: int) -> None:
    """Calibrate with a tenth of all labels grossly wrong, beside the clean run."""
    rows = []
    for seed in watched(range(seeds), seeds, "gross errors", "cells"):
        clean, dirty = _errors(seed, 0.0), _errors(seed, 0.1)
        rows.append([seed, dirty[0], clean[1], dirty[1], dirty[1] / clean[1], dirty[2] / clean[2]])
    headers = ["seed", "status", "clean [mm]", "10 % wrong [mm]", "ratio mm", "ratio deg"]
    _report(output / "gross_errors.csv", headers, rows, "Ten per cent of the labels wrong", 3)
    clean_mm, dirty_mm = (float(np.mean([r[i] for r in rows])) for i in (2, 3))
    _verdict("mean error over the clean one", dirty_mm / clean_mm, LIMITS["gross_ratio"], "x")


def rviz(output: Path, quick: bool) -> None:
    """Count the frames of RViz with our plugins and without."""
    alone, *_ = rates = rviz_rates(5 if quick else 15)
    rows = [
        [
            rate.name,
            rate.frames,
            float(np.median(rate.per_second)),
            float(np.median(rate.per_second / alone.per_second)),
            rate.cpu_ms,
            alone.cpu_ms / rate.cpu_ms,
        ]
        for rate in rates
    ]
    headers = ["RViz", "frames", "frames/s", "ratio", "CPU of a frame [ms]", "ratio of CPU"]
    title = "RViz, a cloud of 131,072 points; medians over turns"
    _report(output / "rviz.csv", headers, rows, title, 2)
    _verdict("frame rate with the plugins over without", rows[2][3], 0.8, "x", at_least=True)
    print()
    leaving_out(output, 1 if quick else 5)


def leaving_out(output: Path, collections: int) -> None:
    """Measure what a click on a bar waits for: the cell solved again without a detection.

    Seconds are of a processor, so that waiting for other programs does not count. The panel shows
    the new answer as soon as it is solved; its verdict follows.
    """
    cell = paper_cell(0, "train", Noise(), DISTURBANCE)
    options = CalibrationOptions()
    left = LeftOut(calibrate(cell.dataset, options), options)
    left.get_ready()
    rows = []
    for sensor in cell.dataset.sensors:
        solved_s, judged_s = [], []
        seen = [d.collection for d, _ in cell.dataset.detections() if d.sensor == sensor]
        for key in seen[:collections]:
            begin_s = time.process_time()
            left.leave_out(sensor, key)
            solved_s.append(time.process_time() - begin_s)
            _ = left.now
            judged_s.append(time.process_time() - begin_s - solved_s[-1])
            left.take_in(sensor, key)
        medians = [float(np.median(times)) for times in (solved_s, judged_s)]
        rows.append([sensor, len(solved_s), medians[0], max(solved_s), medians[1]])
    headers = ["left out of", "times", "solved, median [s]", "longest [s]", "judged, median [s]"]
    _report(output / "leaving_out.csv", headers, rows, "A detection left out, solved again", 3)
    _verdict("solved again, median", float(np.median([r[2] for r in rows])), 0.1, "s")
    print()


def seeds(output: Path, quick: bool) -> None:
    """Measure how soon labels follow a seed that is dragged."""
    from seed_refresh import seed_refresh  # needs ROS

    answers = seed_refresh(output, 30 if quick else 100)
    rows = [
        [
            one.sensor,
            len(one.labels_ms),
            *np.percentile(one.labels_ms, [50, 95]),
            *np.percentile(one.shown_ms, [50, 95]),
            one.detected,
        ]
        for one in answers
    ]
    headers = [
        "sensor",
        "steps",
        "labels 50 % [ms]",
        "labels 95 % [ms]",
        "shown 50 % [ms]",
        "shown 95 % [ms]",
        "detected",
    ]
    _report(output / "seeds.csv", headers, rows, "Labels after a seed is moved, cell live", 2)
    together = np.concatenate([one.labels_ms for one in answers])
    _verdict("labels after a seed, 95th percentile", np.percentile(together, 95), 200, "ms")
    print()


def corrected_labels(output: Path, quick: bool) -> None:
    """Measure how soon a label that was corrected by hand is shown."""
    from label_refresh import label_refresh  # needs ROS

    rows = [
        [one.what, len(one.shown_ms), *_percentiles(one.shown_ms), *_percentiles(one.told_ms)]
        for one in label_refresh(10 if quick else 50)
    ]
    headers = ["corrected", "times"]
    headers += [f"{what} {share} % [ms]" for what in ("shown", "panel") for share in (50, 95)]
    _report(output / "corrected_labels.csv", headers, rows, "Labels corrected by hand", 1)
    _verdict("shown, the slower kind, 95th percentile", max(row[3] for row in rows), 200, "ms")
    print()


def _percentiles(values: np.ndarray) -> np.ndarray:
    return np.percentile(values, [50, 95])


def _trust(args: argparse.Namespace) -> None:
    """Plant faults, then model errors, then all that the rough profile has."""
    trust(args.output, 1 if args.quick else min(args.seeds, 3))
    print()
    model_errors(args.output, 2 if args.quick else args.seeds)


def _report(path: Path, headers: list, rows: list, title: str, digits: int) -> None:
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(headers)
        writer.writerows(rows)
    print(text_table(headers, rows, title, digits))


def _verdict(what: str, value: float, limit: float, unit: str, at_least: bool = False) -> None:
    word = "reached" if (value >= limit if at_least else value <= limit) else "MISSED"
    sign = ">=" if at_least else "<="
    print(f"{what}: {value:.4g} {unit}, to reach {sign} {limit:g} {unit}: {word}")


PARTS: Dict[str, Callable[[argparse.Namespace], None]] = {
    "speed": lambda args: speed(args.output),
    "growth": growth,
    "accuracy": lambda args: accuracy(args.output, 3 if args.quick else args.seeds),
    "starts": lambda args: starts(args.output, 3 if args.quick else args.seeds),
    "convergence": lambda args: convergence(args.output, 10 if args.quick else 5 * args.seeds),
    "gross_errors": lambda args: gross_errors(args.output, 1 if args.quick else min(args.seeds, 5)),
    "rviz": lambda args: rviz(args.output, args.quick),
    "seeds": lambda args: seeds(args.output, args.quick),
    "corrected_labels": lambda args: corrected_labels(args.output, args.quick),
    "trust": _trust,
}

if __name__ == "__main__":
    main()
