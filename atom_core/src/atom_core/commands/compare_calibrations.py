"""Two calibrations of one rig, edge by edge: what `evaluate --compare A B` does."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import List

from atom_core.commands import common
from atom_core.errors import DatasetError
from atom_core.evaluation.changes import Changes, changes, held_apart, held_elsewhere
from atom_core.io.atomic import prepare_output_folder, write_json_atomically
from atom_core.io.calibration_json import StoredCalibration, read_calibration
from atom_core.report.changes_report import changes_document, changes_sentence, changes_table
from atom_core.report.verdict import angle, length, names_in_words
from atom_core.solvers.base import CONVERGED

RESULT_FILE = "comparison.json"


def run_comparison(args: argparse.Namespace, before: Path, after: Path) -> int:
    """Compare two results of `calibrate`; 1 when something moved.

    Args:
        args: of `evaluate`; the document is written where an output folder is named.
        before: a folder of results, or a file in it.
        after: likewise.

    Raises:
        AtomError: one of them is no result, or they hold different sensors.
    """
    if args.output:
        common.refuse_occupied(args.output, args.overwrite)
    first, second = read_calibration(before), read_calibration(after)
    found, warnings = compared(first, second), _warnings(first, second)
    if args.output:
        prepare_output_folder(args.output, args.overwrite)
        document = changes_document(found, str(first.path), str(second.path), warnings)
        write_json_atomically(args.output / RESULT_FILE, document, sort_keys=False)
    print(changes_table(found))
    for warning in warnings:
        print(f"warning: {warning}")
    print(f"\n{changes_sentence(found)}")
    return 1 if found.moved or not found.compared else 0


def _warnings(first: StoredCalibration, second: StoredCalibration) -> List[str]:
    """Return why a comparison of edges and joints may not tell all."""
    warnings = [
        f"{stored.path} is {stored.status}: it is not known how sure it is"
        for stored in (first, second)
        if stored.status != CONVERGED
    ]
    cameras = list(dict.fromkeys([*first.cameras, *second.cameras]))
    if cameras:
        warnings.append(
            f"the intrinsics of {names_in_words(cameras)} were estimated, too; they are not "
            f"compared, and where they differ, so may the places of these cameras"
        )
    return warnings


def compared(first: StoredCalibration, second: StoredCalibration) -> Changes:
    """Return what differs.

    Raises:
        DatasetError: one holds what the other estimates, both hold it in different places, or they
            have no edge in common.
    """
    before, after = first.edges, second.edges
    apart = held_apart(before, after)
    if apart:
        raise DatasetError(
            f"{second.path}: '{apart[0]}' is held in one of the two and estimated in the other; "
            f"calibrate both with the same --anchor_sensors"
        )
    for state, error in held_elsewhere(before, after):
        raise DatasetError(
            f"{second.path}: '{state.edge}' is held {length(error.translation_m)} and "
            f"{angle(error.rotation_rad)} from where {first.path} holds it, and all others are "
            f"told in relation to it; calibrate both from the same description"
        )
    if not {state.edge for state in before} & {state.edge for state in after}:
        raise DatasetError(
            f"{second.path}: has no calibrated edge in common with {first.path}; give two results "
            f"of one rig"
        )
    joints = ([p for joint in s.joints.values() for p in joint] for s in (first, second))
    return changes(before, after, *joints)
