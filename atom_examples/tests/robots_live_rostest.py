#!/usr/bin/env python3
"""Two example robots played back: labeled and collected live, then calibrated, against the truth.

An arm that carries its camera, whose transforms move, and two cameras before a board that moves.
"""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rosunit

from atom_core import cli
from atom_examples.robot_simulator import main as robot_simulator
from atom_examples.robot_simulator.robots import robot_named

STOPS = 5
LIMIT_MM, LIMIT_DEG = 1.0, 0.05


def live(robot, folder):
    """Return the dataset that the nodes make of a recording while it is played."""
    bag, output = f"{folder}/{robot}.bag", f"{folder}/{robot}"
    words = ["--robot", robot, "--bag", bag, "--stops", str(STOPS), "--compressed"]
    assert robot_simulator.main(words) == 0
    config = robot_named(robot).config
    subprocess.run(
        [
            *("roslaunch", "atom_calibration", "collect_data.launch", f"config:={config}"),
            *(f"output_folder:={output}", f"bag:={bag}", "automatic:=true", "rviz:=false"),
            *("bag_rate:=2", "end_when_quiet:=4", "patience:=120"),
        ],
        check=True,
        timeout=240,
    )
    return Path(output) / "dataset.json"


class RobotsLive(unittest.TestCase):
    def test_what_is_collected_live_calibrates(self):
        for robot in ("rihbot", "rrbot"):
            with self.subTest(robot), tempfile.TemporaryDirectory() as folder:
                dataset = live(robot, folder)
                results = f"{folder}/results"
                truth = f"{folder}/{robot}.truth.json"
                line = ["calibrate", "--dataset", str(dataset), "--output", results, "--no_report"]
                self.assertEqual(cli.main([*line, "--truth", truth]), 0)
                document = json.loads(Path(results, "calibration.json").read_text())
                self.assertEqual(len(document["collections"]), STOPS)
                mean = document["ground_truth"]["mean"]
                self.assertLess(1e3 * mean["translation_error_m"], LIMIT_MM)
                self.assertLess(mean["rotation_error_deg"], LIMIT_DEG)


if __name__ == "__main__":
    rosunit.unitrun("atom_examples", "robots_live", RobotsLive, sysargs=sys.argv)
