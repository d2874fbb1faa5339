"""Has the rig moved? False alarms and moves found with three new boards, over many simulated rigs.

Each rig is calibrated with all boards but three: those of which its sensors together see most, as
someone would hold them who wants an answer. With these it is asked whether it moved: when it did
not; and when one sensor, any of them, was shifted by 2 mm or turned by 0.1 deg in a random
direction. *Found* is a move for which anything is called moved, *named* one for which that sensor
alone is.

    nice -n 10 python3 tests/benchmarks/bench_drift.py --rigs 200

With ``--new 6``, six new boards in place of three; as many as before to calibrate with.

With ``--exact``, LiDARs have 1 mm of noise (``ranges``), or the ends of their layers lie on the
board's border (``border``), or both: what is missed then, no better label of that would find.

    nice -n 10 python3 tests/benchmarks/bench_drift.py --exact border --kinds "two cameras, LiDAR"

With ``--known``, rigs of whose sensors and boards the calibration finds errors as well, or how far
an arm is off: the new boards are read with them. There a sensor is shifted by 20 mm or turned by
1 deg.

    nice -n 10 python3 tests/benchmarks/bench_drift.py --known --rigs 20

With ``--cell FOLDER``, the simulated cell as `make results` left it there: calibrated with the
train set of each seed, and asked with threes of the test set's boards that all sensors see. Every
sensor is moved in turn.

    nice -n 10 python3 tests/benchmarks/bench_drift.py --cell results_output
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Tuple

import numpy as np

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import AUTO, OFF, CalibrationOptions
from atom_core.evaluation.drift import Drift, drift
from atom_core.evaluation.edge_spread import known_spread
from atom_core.evaluation.known_errors import known_of
from atom_core.evaluation.spreads import Spread, spreads_of
from atom_core.geometry import se3
from atom_core.io.atomic import write_json_atomically
from atom_core.io.calibration_json import read_calibration
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.report.edge_results import selected_edges
from atom_core.report.tables import text_table
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.realism import PLAIN, ROUGH
from atom_core.synthetic.scenes import random_scene

ROOT = Path(__file__).resolve().parents[2]
TRAINED, NEW = 21, 3  # collections to calibrate with, new ones
THREES = 8  # of the boards of a seed's test set
KINDS = {
    "three cameras": {"rgb": 3, "depth": 0, "lidar3d": 0},
    "two cameras, depth camera": {"rgb": 2, "depth": 1, "lidar3d": 0},
    "two cameras, LiDAR": {"rgb": 2, "depth": 0, "lidar3d": 1},
}
MOVES = {"none": (0.0, 0.0), "2 mm": (0.002, 0.0), "0.1 deg": (0.0, float(np.radians(0.1)))}
EXACT: Mapping[str, Tuple[str, Any]] = {  # an option of `random_scene`
    "ranges": ("noise", Noise(lidar_m=0.001)),
    "border": ("sampling", Sampling(exact_border=True)),
}
LARGER = {"none": (0.0, 0.0), "20 mm": (0.02, 0.0), "1 deg": (0.0, float(np.radians(1.0)))}
AN_ARM = replace(PLAIN, moving_edge_sigma_m=0.0005, moving_edge_sigma_rad=0.0009)
KNOWN = {
    "seven rough sensors": lambda seed: paper_cell(seed, realism=ROUGH, disturbance=(0.02, 0.02)),
    "camera on an arm": lambda seed: scenes.hand_eye(seed, collections=24, realism=AN_ARM),
    "board on an arm": lambda seed: scenes.board_on_arm(seed, collections=24, realism=AN_ARM),
}
Answers = Dict[str, Tuple[bool, bool]]  # by move: anything moved, that sensor alone


def asked(seed: int, sensors: Mapping[str, Any], boards: int = NEW) -> Optional[Answers]:
    """Return what is said of each move of a rig; None where too few boards are seen by all.

    Args:
        seed: of the rig.
        sensors: how many of each modality, and other options of `random_scene`.
        boards: how many new ones.
    """
    dataset = random_scene(seed, collections=TRAINED + boards, **sensors).dataset
    whole = [k for k, c in dataset.collections.items() if len(c.labels) == len(dataset.sensors)]
    if len(whole) < boards:
        return None
    new = sorted(whole, key=lambda key: -_least_share(dataset, key))[:boards]
    rest = [key for key in dataset.collections if key not in new]
    described, spreads = calibrated(dataset.selected(collections=rest))
    new_boards = dataset.selected(collections=new)
    return answers_to(
        MOVES, lambda moved: drift(new_boards, moved, spreads), described, dataset, seed
    )


def asked_of_known(seed: int, scene: Callable[[int], Any]) -> Optional[Answers]:
    """Return likewise what is said of a rig whose calibration finds errors, too."""
    dataset = scene(seed).dataset
    whole = [k for k, c in dataset.collections.items() if len(c.labels) == len(dataset.sensors)]
    new, rest = whole[:NEW], [key for key in dataset.collections if key not in whole[:NEW]]
    solved = calibrate(dataset.selected(collections=rest), CalibrationOptions(model_errors=AUTO))
    if len(whole) < NEW or solved.status != CONVERGED:
        return None
    with TemporaryDirectory() as folder:
        document = calibration_document(calibration_results(solved, "ceres"), {})
        write_json_atomically(Path(folder) / "calibration.json", document)
        stored = read_calibration(Path(folder))
    known = known_of(stored, dataset.selected(collections=new))
    spreads = spreads_of(stored.edges)
    return answers_to(
        LARGER,
        lambda moved: drift(known.dataset, moved, spreads, known.errors, known.moving),
        {state.edge: state.parent_T_child for state in stored.edges},
        dataset,
        seed,
    )


def answers_to(
    moves: Mapping[str, Tuple[float, float]],
    ask: Callable[[Dict[Edge, np.ndarray]], Drift],
    described: Mapping[Edge, np.ndarray],
    dataset: Dataset,
    seed: int,
) -> Answers:
    """Return what is said of each move, of a sensor that chance takes."""
    rng, answers = np.random.default_rng([seed, 1]), {}
    for name, move in moves.items():
        sensor = list(dataset.sensors.values())[rng.integers(len(dataset.sensors))]
        moved = {**described}
        if name != "none":
            moved[sensor.edge] = se3.moved(described[sensor.edge], se3.random_move(*move, rng))
        found = ask(moved)
        answers[name] = bool(found.moved), _names(found) == [sensor.name]
    return answers


def asked_of_cell(folder: Path, seed: int) -> Iterator[Tuple[str, Answers]]:
    """Yield what is said of each move of each sensor of the simulated cell, and its modality."""
    described, spreads = calibrated(read_dataset(folder / "train" / "dataset.json"))
    test = read_dataset(folder / "test" / "dataset.json")
    whole = [k for k, c in test.collections.items() if len(c.labels) == len(test.sensors)]
    rng = np.random.default_rng([seed, 2])
    threes = rng.permutation(list(combinations(whole, NEW)))[:THREES]
    for three in threes:
        new = test.selected(collections=list(three))
        still = bool(drift(new, described, spreads).moved)
        for sensor in test.sensors.values():
            if sensor.edge not in described:
                continue
            answers = {"none": (still, False)}
            for name, move in MOVES.items():
                if name != "none":
                    moved = {**described}
                    moved[sensor.edge] = se3.moved(moved[sensor.edge], se3.random_move(*move, rng))
                    found = drift(new, moved, spreads)
                    answers[name] = bool(found.moved), _names(found) == [sensor.name]
            yield sensor.modality, answers


def _least_share(dataset: Dataset, key: str) -> float:
    """Return how large a board's smallest label is, as a part of that sensor's largest."""
    labels = dataset.collections[key].labels
    largest = dict.fromkeys(dataset.sensors, 1)
    for detection, label in dataset.detections():
        largest[detection.sensor] = max(largest[detection.sensor], label.size)
    return min(label.size / largest[sensor] for (sensor, _), label in labels.items())


def calibrated(dataset: Dataset) -> Tuple[Dict[Edge, np.ndarray], Dict[Edge, Spread]]:
    """Return the edges of a calibration, and how exactly they are known."""
    solved = calibrate(dataset, CalibrationOptions(model_errors=OFF))
    edges = selected_edges(solved)
    return edges, {edge: known_spread(solved, edge) for edge in edges}


def _names(found: Drift) -> List[str]:
    return [name for edge in found.moved for name in edge.sensors]


def figures(rigs: int, ask: Callable[[int], Optional[Answers]]) -> Dict[str, Any]:
    """Return the shares over some rigs; after every twentieth they are printed."""
    answers: List[Answers] = []
    seed = 0
    while len(answers) < rigs:
        found = ask(seed)
        answers += [] if found is None else [found]
        seed += 1
        if found is not None and len(answers) % 20 == 0:
            print(json.dumps(_shares(answers)), flush=True)
    return _shares(answers)


def _shares(answers: List[Answers]) -> Dict[str, Any]:
    row: Dict[str, Any] = {"rigs": len(answers)}
    for name in answers[0]:
        moved, named = np.mean([a[name] for a in answers], axis=0)
        row[name] = {"moved": float(moved), "named": float(named)}
    return row


def figures_of_cell(folder: Path) -> Dict[str, Any]:
    """Return the shares over all seeds of the simulated cell, by modality and together."""
    by_kind: Dict[str, List[Answers]] = {}
    for of_seed in sorted(folder.glob("seed_[0-9]*")):
        if not (of_seed / "test" / "dataset.json").is_file():
            continue
        for modality, answers in asked_of_cell(of_seed, int(of_seed.name.split("_")[1])):
            by_kind.setdefault(modality, []).append(answers)
            by_kind.setdefault("all sensors", []).append(answers)
        for kind, answers_of_kind in by_kind.items():
            print(kind, json.dumps(_shares(answers_of_kind)), flush=True)
    return {f"cell, {kind}": _shares(answers) for kind, answers in by_kind.items()}


def main() -> None:
    """Print the table, and write drift.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=200)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--new", type=int, default=NEW, metavar="BOARDS", help="new boards")
    parser.add_argument("--exact", nargs="+", choices=list(EXACT), default=[], help="of LiDARs")
    parser.add_argument("--known", action="store_true", help="where errors are known")
    parser.add_argument("--cell", type=Path, metavar="FOLDER", help="of `make results`")
    parser.add_argument("--output", type=Path, default=ROOT / "bench_output")
    args = parser.parse_args()
    if args.cell:
        document = figures_of_cell(args.cell)
    else:
        kinds = list(KNOWN) if args.known else args.kinds
        options = dict(EXACT[name] for name in args.exact)
        document = figures_of_kinds(args.rigs, kinds, args.new, options)
    moves = [name for name in (LARGER if args.known else MOVES) if name != "none"]
    args.output.mkdir(parents=True, exist_ok=True)
    write_json_atomically(args.output / "drift.json", document, indent=1)
    headers = ["rig", "asked", "false alarms"]
    headers += [word for name in moves for word in (f"{name} found", "named")]
    rows = [
        [kind, row["rigs"], f"{100 * row['none']['moved']:.1f} %"]
        + [f"{100 * row[m][s]:.1f} %" for m in moves for s in ("moved", "named")]
        for kind, row in document.items()
    ]
    print(text_table(headers, rows, f"Has the rig moved? {args.new} new boards"))


def figures_of_kinds(
    rigs: int, kinds: List[str], boards: int, options: Mapping[str, Any]
) -> Dict[str, Any]:
    """Return the shares over some rigs of each kind; options as of `random_scene`."""
    document = {}
    for kind in kinds:
        print(kind, flush=True)
        if kind in KNOWN:
            document[kind] = figures(rigs, partial(asked_of_known, scene=KNOWN[kind]))
        else:
            sensors = {**KINDS[kind], **options}
            document[kind] = figures(rigs, partial(asked, sensors=sensors, boards=boards))
    return document


if __name__ == "__main__":
    main()
