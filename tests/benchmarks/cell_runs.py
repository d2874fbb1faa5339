"""The main job on the simulated cell, step by step, with what each step costs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Sequence

from atom_core.io.atomic import write_json_atomically
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_json import read_truth
from atom_core.model.dataset import Dataset, pose
from atom_core.model.sensor import RGB
from atom_core.model.truth import Truth, with_truth

CONFIG = Path(__file__).resolve().parents[2] / "atom_examples/collab_cell/config/config.yml"
PLAIN = "plain"
COSTS = "costs.json"
STOPS = {"train": 23, "test": 17}  # as the paper's simulated sets


class Cost(NamedTuple):
    """What a command took: wall clock, processor time of all its threads, largest memory."""

    wall_s: float
    cpu_s: float
    peak_mb: float


@dataclass
class CellRun:
    """The files of one seed, and what making them took.

    Attributes:
        seed: of rig, boards and noise.
        folder: for all files of the seed.
        compressed: whether bags are.
        realism: the simulator's profile, ``plain`` or ``rough``.
        costs: by step, ``collect_train`` and so on; those of an earlier run are read from its file.
    """

    seed: int
    folder: Path
    compressed: bool = True
    realism: str = PLAIN
    costs: Dict[str, Cost] = field(default_factory=dict)

    def bag(self, scenario: str) -> Path:
        """Return the recording."""
        return self.folder / f"{scenario}.bag"

    def truth(self, scenario: str) -> Path:
        """Return the truth file."""
        return self.folder / f"{scenario}.truth.json"

    def labels(self, scenario: str) -> Path:
        """Return the truth of the labels."""
        return self.folder / f"{scenario}.labels.npz"

    def dataset(self, scenario: str) -> Path:
        """Return what was collected."""
        return self.folder / scenario / "dataset.json"

    @property
    def calibration(self) -> Path:
        """The folder of the calibration."""
        return self.folder / "calibration"

    @property
    def evaluation(self) -> Path:
        """The folder of the evaluation."""
        return self.folder / "evaluation"

    def simulate(self, scenario: str, stops: int) -> None:
        """Record a bag, unless the one wanted is there."""
        wanted = {
            "seed": self.seed,
            "scenario": scenario,
            "collections": stops,
            "initial_estimate": "disturbed",
            "compressed": self.compressed,
        }
        if self.bag(scenario).is_file() and _holds(self.truth(scenario), wanted, self.realism):
            return
        options: List[Any] = ["--bag", self.bag(scenario), "--scenario", scenario]
        options += ["--collections", stops, "--seed", self.seed, "--overwrite"]
        options += ["--initial_estimate", "disturbed", "--realism", self.realism]
        options += ["--compressed"] if self.compressed else []
        self._run("simulate", scenario, "atom_examples", "cell_simulator", options)

    def collect(self, scenario: str) -> None:
        """Label the bag, without seeds given by hand."""
        options = ["--config", CONFIG, "--bag", self.bag(scenario), "--pictures"]
        options += ["--output", self.folder / scenario, "--overwrite"]
        self._run("collect", scenario, "atom_calibration", "collect_from_bag", options)

    def calibrate(self, *more: str) -> None:
        """Calibrate the train set from its disturbed start, with further options."""
        options = ["--dataset", self.dataset("train"), "--output", self.calibration]
        options += ["--truth", self.truth("train"), "--overwrite", "--no_report", *more]
        self._run("calibrate", "train", "atom_calibration", "calibrate", options)

    def evaluate(self) -> None:
        """Measure on the test set, against the truth, and beside methods for two sensors."""
        chain = self.folder / "camchain_of_truth.yaml"
        write_camchain_of_truth(chain, self.dataset("train"), self.truth("train"))
        options = ["--train", self.calibration / "atom_calibration.json"]
        options += ["--test", self.dataset("test"), "--truth", self.truth("test")]
        options += ["--baseline", "opencv", "icp", "pairwise", "kalibr"]
        options += ["--initial", self.dataset("train"), "--camchain", chain]
        options += ["--output", self.evaluation, "--overwrite", "--no_report"]
        self._run("evaluate", "test", "atom_calibration", "evaluate", options)

    def evaluation_document(self) -> Dict[str, Any]:
        """Return ``evaluation.json``."""
        return json.loads((self.evaluation / "evaluation.json").read_text(encoding="utf-8"))

    def _run(self, step: str, scenario: str, package: str, command: str, options: Sequence) -> None:
        print(f"seed {self.seed}: {step} {scenario}", file=sys.stderr, flush=True)
        log = self.folder / f"{step}_{scenario}.log"
        call = ["rosrun", package, command, *(str(option) for option in options)]
        self.costs[f"{step}_{scenario}"] = measured(call, log)
        costs = {name: cost._asdict() for name, cost in self.costs.items()}
        write_json_atomically(self.folder / COSTS, costs, indent=1)

    def __post_init__(self) -> None:
        """Read what the steps of an earlier run took."""
        if (self.folder / COSTS).is_file():
            found = json.loads((self.folder / COSTS).read_text(encoding="utf-8"))
            self.costs.update({name: Cost(**cost) for name, cost in found.items()})


def write_camchain_of_truth(path: Path, dataset: Path, truth: Path) -> None:
    """Write what Kalibr would say of the cameras if it made no error."""
    chain = camchain_of(read_dataset(dataset), read_truth(truth))
    write_json_atomically(path, chain, indent=1)  # JSON is YAML


def camchain_of(dataset: Dataset, truth: Truth) -> Dict[str, Any]:
    """Return a camchain of the cameras as they truly are."""
    true = with_truth(dataset, truth)
    first = next(iter(true.collections.values()))
    chain: Dict[str, Any] = {}
    before = ""
    for sensor in true.sensors.values():
        if sensor.modality != RGB or sensor.camera is None:
            continue
        camera = sensor.camera
        entry: Dict[str, Any] = {"camera_model": "pinhole", "distortion_model": "radtan"}
        entry["intrinsics"] = [*map(float, camera.focal_px), *map(float, camera.centre_px)]
        entry["distortion_coeffs"] = [float(value) for value in camera.D[:4]]
        entry["resolution"] = [camera.width, camera.height]
        entry["rostopic"] = sensor.topic
        if before:
            entry["T_cn_cnm1"] = pose(first, true.graph, sensor.frame, before).tolist()
        chain[f"cam{len(chain)}"], before = entry, sensor.frame
    return chain


def measured(call: Sequence[str], log: Path) -> Cost:
    """Run a command, its output into a file; return what it took.

    Raises:
        SystemExit: it failed.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    with log.open("w", encoding="utf-8") as output:
        process = subprocess.Popen(call, stdout=output, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        tail = log.read_text(encoding="utf-8").replace("\r", "\n").splitlines()[-3:]
        raise SystemExit(f"{' '.join(call[:3])} failed ({process.returncode}): " + " ".join(tail))
    cpu_s = usage.ru_utime + usage.ru_stime
    return Cost(time.monotonic() - start, cpu_s, usage.ru_maxrss / 1024.0)


def _holds(truth: Path, wanted: Dict[str, Any], realism: str) -> bool:
    """Tell whether a recording was made as wanted."""
    if not truth.is_file():
        return False
    document = json.loads(truth.read_text(encoding="utf-8"))
    profile = document.get("realism", {}).get("profile", PLAIN)
    return profile == realism and all(document.get(k) == value for k, value in wanted.items())
