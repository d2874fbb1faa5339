"""Say which sensors see which boards in which collections, and how far the joints move."""

from __future__ import annotations

import argparse
from typing import Any, List

import numpy as np

from atom_core.commands import common
from atom_core.model.dataset import Dataset, is_complete
from atom_core.report.tables import text_table

EXAMPLE = "python3 -m atom_core inspect_atom_dataset -json data/dataset.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_options(parser)


def run(args: argparse.Namespace) -> int:
    """Print the tables; a dataset that cannot be calibrated is inspected all the same."""
    dataset = common.selected_dataset(args)
    print("\n\n".join([_completeness(dataset), *_labels(dataset), *_joints(dataset)]))
    for warning in dataset.warnings:
        print(f"warning: {warning}")
    return 0


def _completeness(dataset: Dataset) -> str:
    complete = [key for key in dataset.collections if is_complete(dataset, key)]
    others = [key for key in dataset.collections if key not in complete]
    counts = f"{len(dataset.sensors)} sensors, {len(dataset.collections)} collections"
    return (
        f"{dataset.source}: {counts}\n"
        f"complete: {', '.join(complete) or 'none'}\nincomplete: {', '.join(others) or 'none'}"
    )


def _labels(dataset: Dataset) -> List[str]:
    """Return a table for each pattern."""
    tables = []
    for name in dataset.patterns:
        rows = []
        for key, collection in dataset.collections.items():
            seen = all((sensor, name) in collection.labels for sensor in dataset.sensors)
            rows.append([key, seen, *(_cell(dataset, key, s, name) for s in dataset.sensors)])
        headers = ["Collection", "is complete", *dataset.sensors]
        tables.append(text_table(headers, rows, f"Pattern {name}"))
    return tables


def _cell(dataset: Dataset, key: str, sensor: str, pattern: str) -> str:
    label = dataset.collections[key].labels.get((sensor, pattern))
    if label is None:
        return "not detected"
    board = dataset.patterns[pattern]
    if not label.is_partial(board):
        return "detected"
    return f"partial ({label.summary(board)})"


def _joints(dataset: Dataset) -> List[str]:
    """Return the table of positions; none without joints."""
    positions: dict = {}
    for collection in dataset.collections.values():
        for name, joint in collection.joints.items():
            unit = "m" if joint.is_prismatic else "deg"
            value = joint.position if joint.is_prismatic else np.degrees(joint.position)
            positions.setdefault((name, unit), []).append(float(value))
    if not positions:
        return []
    rows: List[List[Any]] = [
        [name, unit, np.mean(v), np.std(v), np.min(v), np.max(v), np.ptp(v)]
        for (name, unit), v in positions.items()
    ]
    headers = ["Joint", "in", "Mean", "Std", "Min", "Max", "Range"]
    return [text_table(headers, rows, "Positions of the joints")]
