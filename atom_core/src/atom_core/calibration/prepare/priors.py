"""What the user knows beforehand of edges, joints and boards, from options and configuration."""

from __future__ import annotations

from typing import (
    Container,
    Dict,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

from atom_core.calibration.options import CalibrationOptions
from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.priors import Prior
from atom_core.solvers.base import SIGMA

OPTION = "--prior"
_CONFIGURED = "priors of the configuration: "
_NOT_SELECTED = "the selection leaves it out"


class _Target(NamedTuple):
    """What a prior may be of.

    Attributes:
        edge: its own.
        what: words for it.
        joint: the name, of a joint.
        held: why it is not estimated; None where it is.
    """

    edge: Edge
    what: str
    joint: Optional[str]
    held: Optional[str]


def priors(
    dataset: Dataset, options: CalibrationOptions, free: FreeEdges
) -> Tuple[Dict[Edge, Prior], List[str]]:
    """Return what is known beforehand, by edge, and remarks.

    A prior of the options takes the place of that of the configuration.

    Args:
        dataset: its values are those near which edges and joints are expected.
        options: with the priors that were asked for.
        free: what is estimated.

    Raises:
        CalibrationError: an unknown name, an edge that is not estimated or has a prior already, or
            weights that are no variances.
    """
    configured = {n: (p.sigma_m, p.sigma_rad) for n, p in dataset.config.priors.items()}
    if (configured or options.priors) and options.solver.weights != SIGMA:
        whose = OPTION if options.priors else f"a prior ({_CONFIGURED}{', '.join(configured)})"
        raise CalibrationError(f"{whose} needs --weights sigma")
    targets = _targets(dataset, free)
    found: Dict[Edge, Prior] = {}
    for name, sigmas in options.priors.items():
        target = _target(targets, name)
        if target.held is not None:
            raise CalibrationError(
                f"{OPTION} {name}: {target.what} is not estimated ({target.held}); leave the prior "
                f"out, or have it estimated"
            )
        found[target.edge] = _prior(found, dataset, options, (f"{OPTION} ", name), target, sigmas)
    remarks, of_options = [], set(found)
    for name, sigmas in configured.items():
        target = _target(targets, name, _CONFIGURED)
        if target.held == _NOT_SELECTED:
            continue
        if target.held is not None:
            remarks.append(
                f"the configuration's prior of '{name}' has no effect: {target.what} is not "
                f"estimated ({target.held})"
            )
        elif target.edge not in of_options:
            said = (_CONFIGURED, name)
            found[target.edge] = _prior(found, dataset, options, said, target, sigmas)
    return found, remarks


def _target(targets: Mapping[str, _Target], name: str, where: str = f"{OPTION} ") -> _Target:
    if name not in targets:
        there = [n for n, t in targets.items() if t.held is None and n != str(t.edge)]
        raise CalibrationError(
            f"{where}{name}: there is no such sensor, additional tf, joint, fixed pattern or edge; "
            f"those estimated are: {', '.join(there) or 'none'}"
        )
    return targets[name]


def _targets(dataset: Dataset, free: FreeEdges) -> Dict[str, _Target]:
    """Return all that a prior may be of, by name and by edge; what is estimated wins."""
    held = free.held_edges(dataset)
    found: List[Tuple[str, _Target]] = []
    for sensor in dataset.sensors.values():
        why = "it is held" if sensor.edge in held else None
        found.append((sensor.name, _Target(sensor.edge, f"edge '{sensor.edge}'", None, why)))
    for name, entry in dataset.config.additional_tfs.items():
        why = (
            None
            if name in free.additional_tfs
            else "it is not selected with -atsf, or what hangs on it is left out"
        )
        why = "it is held" if entry.edge in held else why
        found.append((name, _Target(entry.edge, f"edge '{entry.edge}'", None, why)))
    for name, joint in dataset.joints.items():
        why = None if name in free.joints else "select it with -jsf, or in the configuration"
        found.append((name, _Target(joint.edge, f"joint '{name}'", name, why)))
    for pattern in dataset.patterns.values():
        why = "boards are held" if free.anchor_patterns else None
        why = why if pattern.fixed else "as it is carried about, each collection has its own place"
        found.append(
            (pattern.name, _Target(board_edge(pattern), f"pattern '{pattern.name}'", None, why))
        )
    found += _not_selected(dataset, {target.edge for _, target in found if target.held is None})
    others = {edge: None for c in dataset.collections.values() for edge in c.transforms}
    for edge in others:
        why = "neither a sensor of the configuration nor an additional_tf is calibrated by it"
        found.append((str(edge), _Target(edge, f"edge '{edge}'", None, why)))
    by_name: Dict[str, _Target] = {}
    for name, target in sorted(found, key=lambda item: item[1].held is not None):
        by_name.setdefault(name, target)
        by_name.setdefault(str(target.edge), target)
    return by_name


def _not_selected(dataset: Dataset, estimated: Container[Edge]) -> Iterator[Tuple[str, _Target]]:
    """Yield the configuration's sensors and boards that the dataset is reduced by.

    An edge that such a sensor shares with one that is used is estimated all the same.
    """
    for name, sensor in dataset.config.sensors.items():
        if name not in dataset.sensors:
            why = None if sensor.edge in estimated else _NOT_SELECTED
            yield name, _Target(sensor.edge, f"edge '{sensor.edge}'", None, why)
    for name, pattern in dataset.config.calibration_patterns.items():
        if name not in dataset.patterns:
            edge = Edge(pattern.parent_link, pattern.link)
            yield name, _Target(edge, f"pattern '{name}'", None, _NOT_SELECTED)


def _prior(
    found: Mapping[Edge, Prior],
    dataset: Dataset,
    options: CalibrationOptions,
    said: Tuple[str, str],
    target: _Target,
    sigmas: Sequence[float],
) -> Prior:
    """Return the prior of a target, by where it was said and its name.

    Raises:
        CalibrationError: there is one already, or the dataset does not say about which value.
    """
    where, name = said
    before = found.get(target.edge)
    if before is not None:
        raise CalibrationError(
            f"{where}{name}: {target.what} has a prior already, that of '{before.name}'; leave "
            f"one of the two out"
        )
    if target.joint is not None:
        added = options.joint_biases.get(target.joint, {})
        values = dataset.joint(target.joint).parameters
        described = {key: value - added.get(key, 0.0) for key, value in values.items()}
        return Prior(name, sigmas[0], sigmas[1], parameters=described)
    poses = {
        key: collection.transforms[target.edge]
        for key, collection in dataset.collections.items()
        if target.edge in collection.transforms
    }
    if not poses:
        raise CalibrationError(
            f"{where}{name}: the dataset does not say where '{target.edge}' is, so nothing can "
            f"be expected of it; put the link into the robot's description, and collect again"
        )
    return Prior(name, sigmas[0], sigmas[1], poses)
