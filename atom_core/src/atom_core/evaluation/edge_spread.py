"""How exactly a calibration knows an edge: the covariance of its pose."""

from __future__ import annotations

from typing import List, Optional, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.weak_directions import edge_covariance, transforms_by_collection
from atom_core.evaluation.spreads import NO_SPREAD, Spread, beyond
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import PoseBlock
from atom_core.solvers.covariance import Covariance


def edge_spread(
    calibration: Calibration, edge: Edge, covariance: Optional[Covariance] = None
) -> Optional[np.ndarray]:
    """Return the covariance (6, 6) of turn [rad] and shift [m] in the parent's axes; None if held.

    Of an edge with a value in each collection, that of the collection where it is known worst.

    Args:
        calibration: whose edge.
        edge: which.
        covariance: another one than the calibration's.
    """
    worst = _known_worst(calibration, edge)
    if worst is None:
        return None
    return _of_block(calibration, *worst, covariance or calibration.covariance)


def spread_collection(calibration: Calibration, edge: Edge) -> Optional[str]:
    """Return of which collection ``edge_spread`` is; None where one value holds for all."""
    worst = _known_worst(calibration, edge)
    return None if worst is None else worst[1].collection


def usual_sigma(calibration: Calibration, edge: Edge) -> Optional[np.ndarray]:
    """Return (6,) medians over the collections of an edge's standard deviations [rad, m].

    About and along the parent's axes, with usual errors where they are known; None where one
    value holds for all collections.
    """
    mine = [(i, block) for i, block in _blocks(calibration, edge) if block.collection is not None]
    spreads = [_of_block(calibration, *block, calibration.covariance.combined) for block in mine]
    return np.sqrt(np.median([np.diagonal(s) for s in spreads], axis=0)) if spreads else None


def _known_worst(calibration: Calibration, edge: Edge) -> Optional[Tuple[int, PoseBlock]]:
    """Return the block of an edge whose variances are largest, a radian as a metre."""
    mine, covariance = _blocks(calibration, edge), calibration.covariance
    if len(mine) < 2:
        return mine[0] if mine else None
    sizes = [np.trace(_of_block(calibration, i, block, covariance)) for i, block in mine]
    return mine[int(np.argmax(sizes))]


def _blocks(calibration: Calibration, edge: Edge) -> List[Tuple[int, PoseBlock]]:
    """Return the blocks of an edge; of many, without those on which nothing seen hangs."""
    mine = [(i, b) for i, b in calibration.problem.parameters.pose_blocks() if b.edge == edge]
    if len(mine) < 2:
        return mine
    of_transform = transforms_by_collection(calibration.problem).get(edge)
    return [(i, b) for i, b in mine if of_transform is None or i in of_transform]


def _of_block(
    calibration: Calibration, index: int, block: PoseBlock, covariance: Covariance
) -> np.ndarray:
    x = calibration.summary.x[calibration.problem.parameters.slice_of(index)]
    return edge_covariance(block, x, covariance.block(index))


def known_spread(calibration: Calibration, edge: Edge) -> Spread:
    """Return how exactly a calibration knows an edge; one that is held exactly."""
    stated = edge_spread(calibration, edge)
    of_model = edge_spread(calibration, edge, calibration.covariance.of_model)
    if stated is None or of_model is None:
        return NO_SPREAD
    names = calibration.dataset.sensors_on(edge)
    detections = sum(key.sensor in names for key in calibration.problem.detections)
    combined = edge_spread(calibration, edge, calibration.covariance.combined)
    usual = NO_SPREAD.usual
    if combined is not None:
        usual = beyond(np.diagonal(combined), np.diagonal(stated))
    freedom = calibration.covariance.freedom
    return Spread(stated, of_model, detections, freedom=freedom, usual=usual)
