"""What calibrations of one pair of sensors share: where the answer goes, how it is shown."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Sequence

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.links import check_separable, edge_value
from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.geometry.units import MM_PER_M
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.tables import text_table
from atom_core.report.verdict import WRONG


def read_pair(args: argparse.Namespace, pair: Sequence[str], kinds: Sequence[str]) -> Dataset:
    """Read the dataset; refuse names that are none of its sensors of these modalities.

    Args:
        args: with the dataset.
        pair: the sensor that is placed, and the one that stays.
        kinds: modalities.

    Raises:
        DatasetError: naming those there are; or the one that stays would move along.
    """
    dataset = read_dataset(args.dataset)
    there = [name for name, sensor in dataset.sensors.items() if sensor.modality in kinds]
    for name in pair:
        if name not in there:
            raise DatasetError(
                f"{args.dataset}: there is no sensor '{name}' of {' or '.join(kinds)}; there are: "
                f"{', '.join(there) or '-'}"
            )
    if pair[0] == pair[1]:
        raise DatasetError(f"{args.dataset}: '{pair[0]}' is named twice; name two sensors")
    check_separable(dataset, pair[1], pair[0])
    return dataset


def with_source(dataset: Dataset, source: str, target: str, pose: np.ndarray) -> Dataset:
    """Return the dataset with the source where it has this pose (4, 4) in the target.

    Raises:
        DatasetError: the two move against each other, or along with each other.
    """
    edge = {dataset.sensors[source].edge: edge_value(dataset, target, source, pose)}
    return dataset.with_transforms(dict.fromkeys(dataset.collections, edge))


def refuted(solved: Dataset, sensors: Sequence[str]) -> str:
    """Return a clause that says how far an answer is from the dataset's own labels.

    Args:
        solved: the dataset with the answer.
        sensors: those that it places, and the one that stays.

    Returns:
        Nothing where no two of them are as far apart as no calibration leaves them.
    """
    found = evaluate(solved, solved, sensors=list(sensors))
    between = replace(found, single=(), spread=())  # where the rig is they say nothing of
    verdicts = evaluation_verdict(between).sensors
    wrong = (f"'{n}' {v.sentence}" for n, v in verdicts.items() if v.grade == WRONG)
    return next(wrong, "")


def pose_table(dataset: Dataset, source: str, target: str, rows: Sequence[tuple]) -> str:
    """Return a table of poses of the source in the target.

    Args:
        dataset: for the frames.
        source: the sensor that is placed.
        target: the one that stays.
        rows: (name, ``target_T_source`` (4, 4), collections) of each.
    """
    headers = ["", "x [mm]", "y [mm]", "z [mm]", "roll [deg]", "pitch [deg]", "yaw [deg]"]
    cells = [
        [
            name,
            *(MM_PER_M * pose[:3, 3]),
            *np.degrees(se3.rpy_from_rotation(pose[:3, :3])),
            collections,
        ]
        for name, pose, collections in rows
    ]
    frames = [dataset.sensors[name].frame for name in (source, target)]
    return text_table([*headers, "collections"], cells, f"{frames[0]} in {frames[1]}")
