"""What a calibration of the simulated cell has to reach; every number stands in limits.yaml."""

import json
import unittest
from pathlib import Path

import numpy as np
from label_truth import scores
from recordings import LIMITS

from atom_core.errors import AtomError
from atom_core.io.dataset_json import read_dataset
from atom_core.model.sensor import LIDAR3D, RGB


class RegressionCase(unittest.TestCase):
    """Collects all that is wrong before it fails, so that one run says everything."""

    _prepared, _problem = False, ""

    @classmethod
    def prepare(cls):
        """Make what the tests look at; not in setUpClass, whose failure rostest does not show."""

    def setUp(self):
        self.faults = []
        cls = type(self)
        if not cls._prepared:
            cls._prepared = True
            try:
                cls.prepare()
            except (AssertionError, AtomError, OSError) as error:
                cls._problem = str(error)
        if cls._problem:
            self.fail(cls._problem)

    def tearDown(self):
        if self.faults:
            raise AssertionError("\n".join(["", *self.faults]))

    def hold(self, what, value, limit, unit="", at_least=False):
        """Note a value that is beyond its limit, or no number."""
        good = value >= limit if at_least else value <= limit
        if not good:
            word = "at least" if at_least else "at most"
            self.faults.append(f"{what}: {value:.4g} {unit}, has to be {word} {limit:.4g} {unit}")

    def check_counts(self, dataset_file, stops):
        """Every stop became a collection."""
        count = len(read_dataset(dataset_file).collections)
        if count != stops:
            self.faults.append(f"{dataset_file}: {count} collections of {stops} stops")

    def check_labels(self, dataset_file, bag):
        """Boards were found where they can be, nowhere else, and labeled exactly."""
        limits = LIMITS["labels"]
        for modality, score in scores(dataset_file, bag).items():
            missed = f"{modality}: share of boards found (not in {', '.join(score.missed)})"
            self.hold(missed, score.share, limits["found"], at_least=True)
            for place in score.false:
                self.faults.append(f"{modality}: {place}: what is labeled is not the board")
            if modality == RGB:
                errors = np.array(score.errors_px)
                self.hold("rgb: number of corners judged", len(errors), limits["corners"], "", True)
                bias, rms = np.abs(errors.mean(axis=0)).max(), np.sqrt((errors**2).mean(axis=0))
                self.hold("rgb: bias of corners", bias, limits["corner_bias_px"], "px")
                self.hold("rgb: RMS of corners", rms.max(), limits["corner_rms_px"], "px")
            else:
                self.hold(f"{modality}: precision", score.precision, limits["precision"], "", True)
            if modality == LIDAR3D:
                self.hold(f"{modality}: recall", score.recall, limits["recall"], "", True)

    def check_calibration(self, folder, collections, limits=LIMITS["poses"]):  # noqa: B008
        """The answer converged, uses everything, and lies near the truth."""
        document = read(Path(folder) / "calibration.json")
        if document["status"] != "converged":
            self.faults.append(f"status {document['status']}: {document['message']}")
        used = sum(entry["used"] for entry in document["collections"].values())
        if used != collections:
            self.faults.append(f"{used} of {collections} collections used")
        self.check_poses(document, limits)

    def check_poses(self, document, limits):
        """Each sensor lies near the truth, by its modality; so does their mean."""
        errors = document["ground_truth"]
        for name, entry in document["sensors"].items():
            limit = limits[entry["modality"]]
            self.hold_pose(f"sensor '{name}'", errors[name], limit)
        self.hold_pose("mean of the sensors", errors["mean"], limits["mean"])

    def hold_pose(self, what, error, limit):
        off_mm, off_deg = 1000 * error["translation_error_m"], error["rotation_error_deg"]
        self.hold(f"{what}: off the truth", off_mm, limit["mm"], "mm")
        self.hold(f"{what}: turned from the truth", off_deg, limit["deg"], "deg")

    def check_pairs(self, file):
        """Every pair was measured; what enough points tell is nearly as good as with the truth."""
        document, judged = read(file), 0
        for pair in document["pairs"]:
            what = f"{pair['kind']} {pair['source']} -> {pair['target']}"
            if pair["skipped"]:
                self.faults.append(f"{what}: not measured: {pair['skipped']}")
                continue
            if pair["at_truth"] is None:
                self.faults.append(f"{what}: the true edges give no figure")
                continue
            if pair["points"] >= LIMITS["pairs"]["least_points"]:
                judged += 1
                limit = LIMITS["pairs"].get(pair["kind"], LIMITS["pairs"]["others"])
                ratio = pair["rms"] / pair["at_truth"]["rms"]
                self.hold(f"{what}: over its value at the truth", ratio, limit)
        share = judged / max(len(document["pairs"]), 1)
        self.hold("share of pairs with enough points", share, LIMITS["pairs"]["judged"], "", True)
        for kind, limit in LIMITS["floor"].items():
            average = document["averages"][kind]
            self.hold(f"average of {kind}", average["rms"], limit, average["unit"])


def read(path):
    return json.loads(Path(path).read_text("utf-8"))
