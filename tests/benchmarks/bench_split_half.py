"""Do two halves of the collections differ as much as their sigmas say? Over many simulated rigs.

The six numbers of every estimated sensor in one half, minus those in the other, in their joint
standard deviations: 95 % should be less than 1.96, and with the sigmas of `calibrate`, which are
wide where collections are few, more are.

    nice -n 10 python3 tests/benchmarks/bench_split_half.py --rigs 50
"""

from __future__ import annotations

import argparse
from typing import Dict, List

import numpy as np

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.edge_spread import edge_spread
from atom_core.evaluation.trust.two_estimates import edge_difference
from atom_core.report.tables import text_table
from atom_core.synthetic.cell import paper_cell

INTERVAL = 1.96  # sigmas, of 95 %
STATED, OF_MODEL = "as stated", "of the assumed noise"


def differences(seed: int) -> Dict[str, List[np.ndarray]]:
    """Return the six numbers (6,) of each sensor's difference in sigmas, of both sorts."""
    dataset = paper_cell(seed).dataset
    keys = list(dataset.collections)
    options = CalibrationOptions(model_errors=OFF)
    halves = [calibrate(dataset.selected(collections=keys[i::2]), options) for i in (0, 1)]
    found: Dict[str, List[np.ndarray]] = {STATED: [], OF_MODEL: []}
    for sensor in dataset.sensors.values():
        if edge_spread(halves[0], sensor.edge) is None:
            continue
        apart, covariance = edge_difference(halves[0], halves[1], sensor.edge)
        found[STATED].append(apart / np.sqrt(np.diagonal(covariance)))
        of_model = [edge_spread(half, sensor.edge, half.covariance.of_model) for half in halves]
        variance = sum(np.diagonal(spread) for spread in of_model if spread is not None)
        found[OF_MODEL].append(apart / np.sqrt(variance))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=50)
    args = parser.parse_args()
    every: Dict[str, List[np.ndarray]] = {STATED: [], OF_MODEL: []}
    for seed in range(args.rigs):
        for name, numbers in differences(seed).items():
            every[name] += numbers
    rows = []
    for name, numbers in every.items():
        sizes = np.abs(np.concatenate(numbers))
        within = 100.0 * np.mean(sizes < INTERVAL)
        rows.append([name, args.rigs, len(sizes), f"{within:.1f} %", f"{np.max(sizes):.1f}"])
    headers = ["sigmas", "rigs", "numbers", "within 95 %", "largest [sigmas]"]
    print(text_table(headers, rows, "Two halves of the collections, simulated cell"))


if __name__ == "__main__":
    main()
