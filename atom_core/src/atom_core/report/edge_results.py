"""What came of the edges and the joints: values, standard deviations, and what priors held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Optional, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.evaluation.edge_spread import edge_spread, spread_collection, usual_sigma
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE, ROTATION, TRANSLATION
from atom_core.problem.priors import Prior
from atom_core.solvers.covariance import LARGEST_VARIANCE, Covariance


@dataclass(frozen=True)
class EdgeResult:
    """A selected edge, estimated or anchored.

    Attributes:
        edge: parent and child.
        sensors: names of those that stand on it.
        anchored: whether it was held.
        parent_T_child: (4, 4); of an edge with a value for each collection, the first.
        sigma: (6,) of turns [rad] and shifts [m] about and along the parent's axes.
        model_sigma: (6,) likewise, as the assumed noise has it.
        combined_sigma: (6,) likewise, with usual errors of sensors and boards; as `sigma` where
            nothing is known of them.
        prior: what the user knew beforehand; None: nothing.
        held: whether a direction of it is held by priors alone.
        covariance: (6, 6) whose diagonal are the squares of `sigma`; None where it was held.
        collection: of an edge with a value for each, that whose sigmas these are: the one where it
            is known worst.
        usual_sigma: (6,) likewise, in the middle of the collections.
    """

    edge: Edge
    sensors: Tuple[str, ...]
    anchored: bool
    parent_T_child: np.ndarray
    sigma: np.ndarray
    model_sigma: np.ndarray
    combined_sigma: np.ndarray
    prior: Optional[Prior] = None
    held: bool = False
    covariance: Optional[np.ndarray] = None
    collection: Optional[str] = None
    usual_sigma: Optional[np.ndarray] = None

    @property
    def sigma_rotation_rad(self) -> np.ndarray:
        """(3,) about the parent's axes."""
        return self.sigma[ROTATION]

    @property
    def sigma_translation_m(self) -> np.ndarray:
        """(3,) along the parent's axes."""
        return self.sigma[TRANSLATION]


@dataclass(frozen=True)
class ParameterResult:
    """An estimated parameter of a joint or of a camera's intrinsics, in its unit.

    Attributes:
        name, unit: of the parameter.
        value, change: at the solution, and since the start.
        sigma: standard deviation.
        combined_sigma: likewise, with usual errors of sensors and boards.
        prior_sigma: what the user knew beforehand, as a standard deviation; None: nothing.
        held: whether a direction of it is held by priors alone.
    """

    name: str
    value: float
    change: float
    sigma: float
    combined_sigma: float
    unit: str
    prior_sigma: Optional[float] = None
    held: bool = False


def selected_edges(calibration: Calibration) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) of every selected edge, estimated or anchored.

    Of an edge with a value for each collection, the first.
    """
    dataset = calibration.dataset
    edges = [*dataset.sensor_edges, *calibration.free.additional_tfs.values()]
    return {edge: dataset.first_value(edge) for edge in edges}


def edge_result(calibration: Calibration, edge: Edge) -> EdgeResult:
    """Return the figures of a selected edge."""
    dataset = calibration.dataset

    def sigma(covariance: Covariance) -> np.ndarray:
        spread = edge_spread(calibration, edge, covariance)
        if spread is None:
            return np.zeros(BLOCK_SIZE)
        return np.sqrt(np.minimum(np.diagonal(spread), LARGEST_VARIANCE))

    spread = edge_spread(calibration, edge)

    return EdgeResult(
        edge,
        dataset.sensors_on(edge),
        edge in calibration.free.held_edges(dataset),
        dataset.first_value(edge),
        sigma(calibration.covariance),
        sigma(calibration.covariance.of_model),
        sigma(calibration.covariance.combined),
        calibration.free.priors.get(edge),
        _is_held(calibration, edge),
        None if spread is None else np.clip(spread, -LARGEST_VARIANCE, LARGEST_VARIANCE),
        spread_collection(calibration, edge),
        usual_sigma(calibration, edge),
    )


def _is_held(calibration: Calibration, edge: Edge, parameter: str = "") -> bool:
    """Tell whether an edge, or a joint's parameter, moves along a direction that priors hold."""
    titles = {b.title for b in calibration.problem.parameters.blocks if b.edge == edge}
    return any(
        title in titles and parameter in ("", component)
        for direction in calibration.held_directions
        for title, component in (name.rsplit(" ", 1) for name in direction.parameters)
    )


def joint_results(calibration: Calibration) -> Dict[str, Tuple[ParameterResult, ...]]:
    """Return the estimated parameters by joint."""
    found: Dict[str, Tuple[ParameterResult, ...]] = {}
    for i, block in calibration.problem.parameters.joint_blocks():
        sigma, combined = np.sqrt(np.minimum(block_variances(calibration, i), LARGEST_VARIANCE))
        now, before = (d.joint(block.joint) for d in (calibration.dataset, calibration.initial))
        found[block.joint] = found.get(block.joint, ()) + tuple(
            ParameterResult(
                name,
                now.parameters[name],
                now.parameters[name] - before.parameters[name],
                float(sigma[place]),
                float(combined[place]),
                now.unit(name),
                None if block.prior is None else block.prior.sigma(now.unit(name)),
                _is_held(calibration, block.edge, name),
            )
            for place, name in block.free_components
        )
    return found


def block_variances(calibration: Calibration, block: int) -> Tuple[np.ndarray, np.ndarray]:
    """Return (6,) variances of a parameter block's numbers: as stated, and combined."""
    covariance = calibration.covariance
    stated, combined = (np.diagonal(c.block(block)) for c in (covariance, covariance.combined))
    return stated, combined
