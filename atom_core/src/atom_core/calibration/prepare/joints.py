"""Which joints are calibrated, and whether the dataset knows enough of them."""

from __future__ import annotations

from typing import Dict, List, Sequence, Tuple

import numpy as np

from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.joints import JOINT_PARAMETERS, JointSelection
from atom_core.model.selection import is_lambda, select_names
from atom_core.problem.builder import FreeEdges

_SAME_M, _SAME_RAD = 1e-3, 2e-3  # of a transform and what the joint's position says


def configured_joints(dataset: Dataset) -> Dict[str, Tuple[str, ...]]:
    """Return the parameters that the configuration asks for, by joint."""
    return {name: entry.params_to_calibrate for name, entry in dataset.config.joints.items()}


def select_joints(
    dataset: Dataset, joints: Sequence[str], parameters: Sequence[str]
) -> JointSelection:
    """Return the parameters to calibrate, by joint, of a user's selections.

    Args:
        dataset: its configuration names joints and parameters; a joint that only the collections
            know can be selected by its name, with any parameters.
        joints: names, globs, lambdas; empty for those of the configuration.
        parameters: likewise; empty for those of the configuration.

    Lambdas may hold for nothing, as in ATOM: then no joint is calibrated.

    Raises:
        SelectionError: a selection by name leaves nothing.
        CalibrationError: neither configuration nor collections know a joint, or a joint selected
            by name is left without a parameter.
    """
    configured = configured_joints(dataset)
    known = {**dict.fromkeys(dataset.joints, JOINT_PARAMETERS), **configured}
    by_name = not all(map(is_lambda, [*joints, *parameters]))
    if not known and by_name:
        raise CalibrationError(
            "there are no joints to select: neither the configuration's 'joints' nor the "
            "collections name any; name them in the configuration, and collect again"
        )
    candidates = configured or (known if by_name or (joints and parameters) else {})
    candidates = {**candidates, **{n: known[n] for n in joints if n in known}}
    names = select_names(candidates, joints or None, "joint", may_be_empty=True)
    wanted = select_names(JOINT_PARAMETERS, parameters or None, "joint parameter", True)
    chosen = {
        name: _parameters_of(name, known[name], wanted, name in configured or bool(parameters))
        for name in names
    }
    bare = [name for name in names if not chosen[name]]
    if bare and not all(map(is_lambda, joints)):
        raise CalibrationError(
            f"joint '{bare[0]}' has none of the selected parameters; the configuration names "
            f"{', '.join(known[bare[0]])}"
        )
    chosen = {name: of_joint for name, of_joint in chosen.items() if of_joint}
    if names and not chosen and not all(map(is_lambda, parameters)):
        raise CalibrationError(
            f"no joint has the selected parameters ({', '.join(wanted)}); change the selection"
        )
    return chosen


def _parameters_of(
    name: str, known: Sequence[str], wanted: Sequence[str], are_named: bool
) -> Tuple[str, ...]:
    if not are_named:
        raise CalibrationError(
            f"joint '{name}': the configuration names no parameters of it; select them with "
            f"--joint_parameter_selection_function, of {', '.join(JOINT_PARAMETERS)}"
        )
    return tuple(p for p in known if p in wanted)


def check_joints(dataset: Dataset, free: FreeEdges) -> None:
    """Refuse joints that cannot be calibrated.

    Raises:
        CalibrationError: an unknown joint or parameter, a collection without its position, a
            geometry that differs between collections, or an edge that is estimated already.
    """
    taken = {s.edge: f"sensor '{s.name}'" for s in dataset.sensors.values()}
    taken.update({edge: f"additional tf '{name}'" for name, edge in free.additional_tfs.items()})
    taken.update({board_edge(p): f"pattern '{p.name}'" for p in dataset.patterns.values()})
    for name, parameters in free.joints.items():
        unknown = [p for p in parameters if p not in JOINT_PARAMETERS]
        if unknown or not parameters:
            what = f"parameter '{unknown[0]}' is unknown" if unknown else "no parameter is named"
            raise CalibrationError(f"joint '{name}': {what}; use {', '.join(JOINT_PARAMETERS)}")
        _check_joint(dataset, name)
        edge = dataset.joint(name).edge
        if edge in taken:
            raise CalibrationError(
                f"joint '{name}': its edge '{edge}' is estimated already, of {taken[edge]}; remove "
                f"one of the two from the configuration"
            )
        taken[edge] = f"joint '{name}'"


def _check_joint(dataset: Dataset, name: str) -> None:
    lacking = [key for key, c in dataset.collections.items() if name not in c.joints]
    if lacking:
        everywhere = len(lacking) == len(dataset.collections)
        where = (
            "no collection has its position"
            if everywhere
            else f"its position is absent from collection {', '.join(lacking)}"
        )
        raise CalibrationError(
            f"joint '{name}' is to be calibrated, but {where}; collect again with the joint in "
            f"the configuration, or hold all joints with --hold_joints"
        )
    (key, first), *others = [(k, c.joints[name]) for k, c in dataset.collections.items()]
    for other_key, other in others:
        same = (first.edge, first.type, first.parameters) == (
            *(other.edge, other.type, other.parameters),
        )
        if not same or not np.allclose(first.axis, other.axis):
            raise CalibrationError(
                f"joint '{name}': origin, bias, axis, type or links differ between collections "
                f"{key} and {other_key}, but hold for all; they are of two robots, or one of them "
                f"was calibrated: merge datasets as they were collected, or leave one side out "
                f"with -csf"
            )


def with_joint_transforms(dataset: Dataset, free: FreeEdges) -> Tuple[Dataset, List[str]]:
    """Return the dataset with the edges of its free joints as positions say, and remarks."""
    solved = dataset.with_joint_parameters({name: {} for name in free.joints})
    remarks = []
    for name in free.joints:
        edge = dataset.joint(name).edge
        apart = [
            se3.pose_difference(before.transforms[edge], after.transforms[edge])
            for before, after in zip(dataset.collections.values(), solved.collections.values())
            if edge in before.transforms
        ]
        metres, radians = np.max(apart, axis=0) if apart else (0.0, 0.0)
        if metres > _SAME_M or radians > _SAME_RAD:
            remarks.append(
                f"joint '{name}': the transforms '{edge}' differ from what its positions say, by "
                f"up to {1e3 * metres:.1f} mm and {np.rad2deg(radians):.2f} deg; the positions "
                f"are used"
            )
    return solved, remarks
