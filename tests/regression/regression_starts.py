#!/usr/bin/env python3
"""From several starts, each disturbed in its own way, the answer is the same and true."""

import sys

import numpy as np
import recordings
import rosunit
from regression_case import LIMITS, RegressionCase, read

from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.truth_json import read_truth
from atom_core.model.truth import Truth, with_truth

OUTPUT = recordings.FOLDER / "starts"


def with_true_mounts():
    """Return the path of the train dataset with the true edges, beside its data files."""
    path = recordings.dataset("train")
    exact = path.with_name("true_mounts.json")
    edges = read_truth(recordings.truth("train")).edges
    write_dataset(with_truth(read_dataset(path), Truth(edges)), exact)
    return exact


class Starts(RegressionCase):
    @classmethod
    def prepare(cls):
        limits = LIMITS["starts"]
        cls.dataset, cls.answers = with_true_mounts(), {}
        for seed in range(limits["seeds"]):
            recordings.run(
                "rosrun",
                "atom_calibration",
                "calibrate",
                "--dataset",
                cls.dataset,
                "--output",
                OUTPUT / str(seed),
                "--overwrite",
                "--no_report",
                "--truth",
                recordings.truth("train"),
                "--noisy_initial_guess",
                *limits["disturbance"],
                "--sample_seed",
                seed,
            )
            cls.answers[seed] = OUTPUT / str(seed)

    def test_1_each_start_leads_to_the_truth(self):
        for seed, folder in self.answers.items():
            before = len(self.faults)
            self.check_calibration(folder, LIMITS["scenario"]["train"])
            self.faults[before:] = [f"start {seed}: {fault}" for fault in self.faults[before:]]

    def test_2_all_starts_lead_to_one_answer(self):
        documents = {seed: read(f / "calibration.json") for seed, f in self.answers.items()}
        for name, edge in documents[0]["edges"].items():
            poses = [pose(document["edges"][name]) for document in documents.values()]
            apart = [se3.inverse(poses[0]) @ other for other in poses]
            away_mm = 1000 * max(np.linalg.norm(move[:3, 3]) for move in apart)
            away_deg = np.degrees(max(se3.rotation_angle(move[:3, :3]) for move in apart))
            limits = LIMITS["starts"]
            self.hold(f"{edge['sensors']}: starts disagree", away_mm, limits["spread_mm"], "mm")
            self.hold(f"{edge['sensors']}: starts disagree", away_deg, limits["spread_deg"], "deg")

    def test_3_the_start_was_really_disturbed(self):
        options = read(self.answers[0] / "calibration.json")["options"]
        self.assertEqual(options["noisy_initial_guess"], LIMITS["starts"]["disturbance"])
        iterations = read(self.answers[0] / "calibration.json")["solver"]["iterations"]
        self.assertGreater(iterations, 3)


def pose(edge):
    rotation = se3.rotation_from_quaternion(np.array(edge["quaternion_xyzw"]))
    return se3.transform(rotation, np.array(edge["translation_m"]))


if __name__ == "__main__":
    rosunit.unitrun("atom", "regression_starts", Starts, sysargs=sys.argv)
