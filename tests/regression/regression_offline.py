#!/usr/bin/env python3
"""calibrate_from_bag.launch on a recording of the simulated cell, from a start far off."""

import sys

import recordings
import rosunit
from regression_case import LIMITS, RegressionCase, read

OUTPUT = recordings.FOLDER / "offline"


class Offline(RegressionCase):
    @classmethod
    def prepare(cls):
        cls.bag = recordings.bag("train")
        recordings.run(
            "roslaunch",
            "atom_calibration",
            "calibrate_from_bag.launch",
            f"config:={recordings.CONFIG}",
            f"bag:={cls.bag}",
            f"output:={OUTPUT}",
            f"truth:={recordings.truth('train')}",
            "overwrite:=true",
            "report:=false",
        )
        cls.status = read(OUTPUT / "status.json")
        recordings.share_dataset("train", OUTPUT / "dataset")

    def test_1_the_launch_file_says_that_it_is_done(self):
        self.assertEqual((self.status["step"], self.status["exit_code"]), ("calibrate", 0))
        self.assertTrue(self.status["message"].startswith("converged"), self.status)

    def test_2_each_stop_is_a_collection_and_labels_are_the_board(self):
        self.check_counts(OUTPUT / "dataset" / "dataset.json", LIMITS["scenario"]["train"])
        self.check_labels(OUTPUT / "dataset" / "dataset.json", self.bag)

    def test_3_the_sensors_are_where_they_truly_are(self):
        self.check_calibration(OUTPUT / "calibration", LIMITS["scenario"]["train"])

    def test_4_pairs_of_sensors_agree_on_other_recordings(self):
        self.check_counts(recordings.dataset("test"), LIMITS["scenario"]["test"])
        recordings.evaluate(OUTPUT)
        self.check_pairs(OUTPUT / "evaluation" / "evaluation.json")


if __name__ == "__main__":
    rosunit.unitrun("atom", "regression_offline", Offline, sysargs=sys.argv)
