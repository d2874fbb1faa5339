"""The simulated cell without pictures: labels are drawn at the truth with the committed noise.

It needs no bags and some 20 s of a processor for a seed, so that five seeds are quickly done.
Clouds are those of boards and bare walls, and ICP is left out.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Any, Dict, Sequence

from paper_tables import paper_tables, rigs_against_truth

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.baselines.comparison import Measured, compare_rigs
from atom_core.evaluation.baselines.pairwise import PAIRWISE, pairwise_baseline
from atom_core.evaluation.baselines.stereo import OPENCV, stereo_baseline
from atom_core.evaluation.evaluate import evaluate
from atom_core.report.evaluation_document import evaluation_document
from atom_core.synthetic.cell import paper_cell

DISTURBANCE = (0.1, 0.1)  # m, rad
METHODS = (OPENCV, PAIRWISE)


def drawn_document(seed: int) -> Dict[str, Any]:
    """Return the evaluation of a seed's calibration, as ``evaluation.json`` has it."""
    train = paper_cell(seed, "train", disturbance=DISTURBANCE)
    test = paper_cell(seed, "test", disturbance=DISTURBANCE)
    solved = calibrate(train.dataset, CalibrationOptions(model_errors=OFF)).dataset
    evaluation = evaluate(solved, test.dataset, truth=test.truth)
    measured = Measured(solved, test.dataset, evaluation, test.truth)
    rigs = [stereo_baseline(solved), pairwise_baseline(solved)]
    return evaluation_document(evaluation, baselines=compare_rigs(rigs, measured))


def drawn_part(seeds: Sequence[int]) -> Dict[str, Any]:
    """Return the paper's tables, and errors against the truth, of some seeds."""
    documents = []
    for seed in seeds:
        print(f"seed {seed}: labels drawn", file=sys.stderr, flush=True)
        documents.append(drawn_document(seed))
    return {
        "tables": paper_tables(documents, METHODS),
        "rigs": rigs_against_truth(documents),
        "seeds": list(seeds),
        "made": {"date": time.strftime("%Y-%m-%d"), "cores": os.cpu_count()},
    }
