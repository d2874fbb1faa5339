"""One measurement of `make bench`, in a process of its own so that its memory is its own.

Reads a pickled dataset, calibrates it, prints one line of JSON.
"""

from __future__ import annotations

import argparse
import json
import pickle
import time
from pathlib import Path
from typing import Any, Dict

import numpy as np
from plain_ceres import PlainCeres

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import prepare
from atom_core.calibration.start.starts import initial_problem, rough_solution
from atom_core.model.dataset import Dataset
from atom_core.solvers.base import SolverOptions, SolverSetup
from atom_core.solvers.choice import solver_factory
from atom_core.solvers.reweighting import atom_normalisers


def main() -> None:
    """Measure what the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--solver", default="ceres")
    parser.add_argument("--weights", default="sigma")
    parser.add_argument("--loss", default="cauchy")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--plain", type=Path, help="folder of the plain program, to be run too")
    args = parser.parse_args()
    began = time.perf_counter()
    with args.dataset.open("rb") as stream:
        dataset = pickle.load(stream)
    load_s = time.perf_counter() - began
    options = CalibrationOptions(
        solver=SolverOptions(weights=args.weights, loss=args.loss), solver_name=args.solver
    )
    result = calibrated(dataset, options, args.repeat)
    result.update(load_s=load_s, peak_mb=peak_mb())
    if args.plain:
        result.update(compared(dataset, options, args.repeat, args.plain))
    print(json.dumps(result))


def peak_mb() -> float:
    """Return the largest memory of this process so far (ru_maxrss would count the parent's)."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / 1024
    raise OSError("/proc/self/status tells no peak")


def calibrated(dataset: Dataset, options: CalibrationOptions, repeat: int) -> Dict[str, Any]:
    """Calibrate; the times are those of the run whose solve was fastest."""
    best = calibrate(dataset, options)
    for _ in range(repeat - 1):  # none but the best is kept, for the memory's sake
        best = min(best, calibrate(dataset, options), key=lambda run: run.seconds["solve"])
    return {
        "detections": len(best.problem.detections),
        "rows": best.problem.row_count,
        "parameters": best.problem.parameters.size,
        "status": best.status,
        "iterations": best.summary.iterations,
        "cost": best.summary.cost_final,
        **{f"{name}_s": seconds for name, seconds in best.seconds.items()},
    }


def compared(
    dataset: Dataset, options: CalibrationOptions, repeat: int, folder: Path
) -> Dict[str, Any]:
    """Solve by the plain program and by ours in turns, with ATOM's weights from the same start.

    Ours is timed with everything it does, from the posed problem to the answer. The plain program
    would stay in another minimum where a board begins in the mirrored pose; it is given the poses
    that ours found for such boards, and is not charged for that.
    """
    prepared, setup = (
        prepare(dataset, options),
        SolverSetup(options.solver, solver_factory("ceres")),
    )
    rough = rough_solution(initial_problem(dataset, prepared.measurements, prepared.free), setup)
    problem = rough.solver.problem
    sigmas = atom_normalisers(rough.first, np.zeros(problem.parameters.size))
    plain = PlainCeres(folder)
    data = plain.write(problem, sigmas)
    atom = CalibrationOptions(
        solver=SolverOptions(weights="atom", loss="none"), solver_name="ceres"
    )
    theirs, ours, defaults = [], [], []
    for _ in range(repeat):
        theirs.append(plain.run(data))
        ours.append(calibrate(dataset, atom))
        defaults.append(calibrate(dataset, options).seconds)
    data.unlink()
    fastest = min(ours, key=lambda run: run.seconds["solve"])
    return {
        "plain_s": min(run.seconds for run in theirs),
        "plain_cost": theirs[0].cost,
        "plain_iterations": theirs[0].iterations,
        "atom_none_s": fastest.seconds["solve"],
        "atom_none_cost": fastest.summary.cost_final,
        "solve_s": min(seconds["solve"] for seconds in defaults),
        "checked_s": min(seconds["solve"] + seconds["covariance"] for seconds in defaults),
    }


if __name__ == "__main__":
    main()
