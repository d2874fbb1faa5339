"""How exactly the calibration carries a point from one sensor to another.

The sigmas of two edges do not tell it: what both share cancels, and an error of angle counts by
distance. So the joint covariance of the whole chain between the two sensors is used, and the
point's deviation in the target is given in metres and, for cameras, in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.sensor import Sensor
from atom_core.problem.builder import pose_chains
from atom_core.problem.parameters import Parameters
from atom_core.solvers.covariance import LARGEST_VARIANCE, Covariance

DISTANCES_M = (1.0, 2.0, 4.0)


class PropagatedPoint(NamedTuple):
    """A point that the calibration carries from one sensor to another.

    Attributes:
        distance_m: from the source.
        point_in_source_m: (3,) where it is: on the optical axis (cameras) or the x axis
            (LiDARs), or the nearest place to it that the target camera sees.
        visible: whether the target camera sees it; None for LiDARs.
        sigma_m: root mean squared displacement in the target's frame that the uncertainty of the
            calibration makes.
        sigma_px: the same in the target's image; None for LiDARs and where it is not visible.
        combined_sigma_m, combined_sigma_px: likewise, with usual errors of sensors and boards.
    """

    distance_m: float
    point_in_source_m: np.ndarray
    visible: Optional[bool]
    sigma_m: float
    sigma_px: Optional[float]
    combined_sigma_m: float
    combined_sigma_px: Optional[float]


@dataclass(frozen=True)
class SensorPair:
    """The way from one sensor to another.

    Attributes:
        source, target: names of the sensors.
        target_T_source: (4, 4) calibrated pose.
        twist_covariance: (6, 6) of its left twist (rotation [rad], move [m]) in the target.
        combined_twist_covariance: (6, 6) likewise, with usual errors of sensors and boards.
    """

    source: str
    target: str
    target_T_source: np.ndarray
    twist_covariance: np.ndarray
    combined_twist_covariance: np.ndarray


def sensor_pairs(
    dataset: Dataset, parameters: Parameters, x: np.ndarray, covariance: Covariance
) -> List[SensorPair]:
    """Return every ordered pair of sensors with its pose's covariance.

    Args:
        dataset: its transforms are the values of what is no parameter; where the robot moves,
            those of its first collection serve.
        parameters: what was estimated.
        x: the solution.
        covariance: of the parameters.
    """
    first, sensors = next(iter(dataset.collections)), list(dataset.sensors.values())
    named = [(s, t) for s in sensors for t in sensors if s != t]
    chains = pose_chains(dataset, [(first, t.frame, s.frame) for s, t in named], parameters)
    poses = parameters.poses(x)
    twists = parameters.twist_jacobians(x, poses)
    target_T_source, jacobians = chains.poses_and_jacobians(poses, twists)
    both = [c.states(chains.block, jacobians) for c in (covariance, covariance.combined)]
    return [
        SensorPair(source.name, target.name, pose, *twists)
        for (source, target), pose, *twists in zip(named, target_T_source, *both)
    ]


def propagate(
    pairs: Sequence[SensorPair],
    sensors: Mapping[str, Sensor],
    distances_m: Sequence[float] = DISTANCES_M,
) -> List[List[PropagatedPoint]]:
    """Return, for each pair, the deviations of points at some distances from the source."""
    rays = {
        name: sensors[name].kind.rays(sensors[name]) for name in {pair.source for pair in pairs}
    }
    return [
        [_carried(pair, sensors[pair.target], rays[pair.source], d) for d in distances_m]
        for pair in pairs
    ]


def _carried(
    pair: SensorPair, target: Sensor, rays: np.ndarray, distance_m: float
) -> PropagatedPoint:
    chosen, visible = 0, None
    if target.camera is not None:
        for candidates in (rays[:1], rays):  # the axis mostly does
            points = se3.apply(pair.target_T_source, distance_m * candidates)
            seen = target.camera.in_image(points)
            visible, chosen = bool(np.any(seen)), int(np.argmax(seen))
            if visible:
                break
    point_in_source = distance_m * rays[chosen]
    point = se3.apply(pair.target_T_source, point_in_source[None])
    by_twist = np.concatenate([-se3.skew(point[0]), np.eye(3)], axis=1)
    by_point = None
    if target.camera is not None and visible:
        by_point = target.camera.project_with_jacobian(point)[1][0]

    def deviation(covariance: np.ndarray) -> Tuple[float, Optional[float]]:
        displacement = by_twist @ covariance @ by_twist.T
        if by_point is None:
            return _root_trace(displacement), None
        return _root_trace(displacement), _root_trace(by_point @ displacement @ by_point.T)

    return PropagatedPoint(
        distance_m,
        point_in_source,
        visible,
        *deviation(pair.twist_covariance),
        *deviation(pair.combined_twist_covariance),
    )


def _root_trace(covariance: np.ndarray) -> float:
    return float(np.sqrt(min(max(np.trace(covariance), 0.0), LARGEST_VARIANCE)))
