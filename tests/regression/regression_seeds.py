#!/usr/bin/env python3
"""Seeds by hand, automatic ones switched off: the labels of the automatic run."""

import sys

import numpy as np
import recordings
import rosunit
from regression_case import LIMITS, RegressionCase

from atom_core.io.dataset_json import read_dataset
from atom_core.io.seeds import Seed, write_seeds
from atom_core.model.dataset import range_points
from atom_core.model.sensor import DEPTH

OUTPUT = recordings.FOLDER / "seeds"


def stamp_s(dataset, key, sensor):
    stamp = dataset.document["collections"][key]["data"][sensor]["header"]["stamp"]
    return stamp["secs"] + 1e-9 * stamp["nsecs"]


def range_labels(dataset):
    """Return the indices of each range label by (stamp, sensor)."""
    return {
        (round(stamp_s(dataset, key.collection, key.sensor), 3), key.sensor): set(label.indices)
        for key, label in dataset.detections()
        if dataset.sensors[key.sensor].kind.measures_range
    }


def seeds_by_hand(dataset, rng):
    """Return what a hand would set: the middle of what is seen of the board, off by centimetres."""
    seeds = []
    for key, _ in dataset.detections():
        sensor = dataset.sensors[key.sensor]
        if not sensor.kind.measures_range:
            continue
        middle = range_points(dataset, key).inside.mean(axis=0)
        place = middle + rng.normal(0.0, LIMITS["seeds"]["hand_m"], 3)
        in_image = sensor.modality == DEPTH
        position = sensor.camera.project(place[None])[0] if in_image else place
        seeds.append(Seed(sensor.name, position, stamp_s(dataset, key.collection, key.sensor)))
    return seeds


class Seeds(RegressionCase):
    @classmethod
    def prepare(cls):
        automatic = read_dataset(recordings.dataset("train"))
        cls.automatic = range_labels(automatic)
        file = recordings.FOLDER / "by_hand.yaml"
        write_seeds(file, seeds_by_hand(automatic, np.random.default_rng(0)), automatic.sensors)
        times = [
            np.mean([stamp_s(automatic, key, s) for s in entry["data"]])
            for key, entry in automatic.document["collections"].items()
        ]
        recordings.run(
            "rosrun",
            "atom_calibration",
            "collect_from_bag",
            "--config",
            recordings.CONFIG,
            "--bag",
            recordings.bag("train"),
            "--output",
            OUTPUT,
            "--overwrite",
            "--seeds",
            file,
            "--automatic_seeds",
            "off",
            "--times",
            *times,
        )
        cls.by_hand = range_labels(read_dataset(OUTPUT / "dataset.json"))

    def test_1_labels_are_those_of_automatic_seeds(self):
        self.assertGreaterEqual(len(self.automatic), 2 * LIMITS["scenario"]["train"])
        for (time_s, sensor), label in self.automatic.items():
            found = self.by_hand.get((time_s, sensor), set())
            share = len(found & label) / len(found | label)
            what = f"{sensor} at {time_s}: overlap with the automatic label"
            self.hold(what, share, LIMITS["seeds"]["overlap"], at_least=True)

    def test_2_nothing_is_labeled_without_a_seed(self):
        self.assertLessEqual(self.by_hand.keys(), self.automatic.keys())


if __name__ == "__main__":
    rosunit.unitrun("atom", "regression_seeds", Seeds, sysargs=sys.argv)
