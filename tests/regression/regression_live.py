#!/usr/bin/env python3
"""collect_data.launch on a recording played with /clock; then calibrate and evaluate."""

import sys

import recordings
import rosunit
from regression_case import LIMITS, RegressionCase, read

OUTPUT = recordings.FOLDER / "live"


class Live(RegressionCase):
    @classmethod
    def prepare(cls):
        cls.bag = recordings.bag("train")
        live = LIMITS["live"]
        recordings.run(
            "roslaunch",
            "atom_calibration",
            "collect_data.launch",
            f"config:={recordings.CONFIG}",
            f"output_folder:={OUTPUT / 'dataset'}",
            f"bag:={cls.bag}",
            f"bag_rate:={live['bag_rate']}",
            "automatic:=true",
            f"end_when_quiet:={live['end_when_quiet_s']}",
            "patience:=120",
            "rviz:=false",
            "overwrite:=true",
        )
        cls.status = read(OUTPUT / "dataset" / "status.json")
        cls.dataset = OUTPUT / "dataset" / "dataset.json"
        if cls.status["exit_code"] > 1:
            raise AssertionError(f"collect_data.launch: {cls.status['message']}")
        recordings.run(
            "rosrun",
            "atom_calibration",
            "calibrate",
            "--dataset",
            cls.dataset,
            "--truth",
            recordings.truth("train"),
            "--output",
            OUTPUT / "calibration",
            "--overwrite",
            "--no_report",
        )

    def test_1_each_stop_is_a_collection_and_labels_are_the_board(self):
        self.assertEqual(self.status["step"], "collect")
        self.check_counts(self.dataset, LIMITS["scenario"]["train"])
        self.check_labels(self.dataset, self.bag)

    def test_2_the_sensors_are_where_they_truly_are(self):
        self.check_calibration(OUTPUT / "calibration", LIMITS["scenario"]["train"])

    def test_3_pairs_of_sensors_agree_on_other_recordings(self):
        recordings.evaluate(OUTPUT)
        self.check_pairs(OUTPUT / "evaluation" / "evaluation.json")


if __name__ == "__main__":
    rosunit.unitrun("atom", "regression_live", Live, sysargs=sys.argv)
