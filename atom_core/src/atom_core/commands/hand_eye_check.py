"""Whether a robot's poses are those of its hand in its base, or inverted, by the images."""

from __future__ import annotations

from typing import Dict, List, NamedTuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.hand_eye_views import board_of, hand_eye_views
from atom_core.evaluation.observed import Observed
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import hand_eye_pose
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.report.verdict import length

_FEWEST = 4  # poses; three fit too much
_FAR_BETTER = 5.0  # times nearer together, no noise explains it
_STAYS = 0.05  # of its distance: a board that is found within it stays where it is


class _Spread(NamedTuple):
    """How far places of a board are from their middle [m], and over its distance.

    Infinite where no pose of the camera explains any of them.
    """

    metres: float
    of_distance: float


def remarks_on_poses(dataset: Dataset, arm: Edge) -> List[str]:
    """Return a sentence where the images fit the inverses of the robot's poses alone.

    Args:
        dataset: of images and poses.
        arm: base and hand.
    """
    observed = Observed(dataset)
    turned = {key: {arm: se3.inverse(c.transforms[arm])} for key, c in dataset.collections.items()}
    as_they_are = _spreads(dataset, observed)
    inverted = _spreads(dataset.with_transforms(turned), observed)
    for camera in (name for name in as_they_are if name in inverted):
        before, after = as_they_are[camera], inverted[camera]
        if after.metres < before.metres / _FAR_BETTER and after.of_distance < _STAYS:
            apart = "in no one place"
            if np.isfinite(before.metres):
                apart = f"in places {length(before.metres)} apart"
            return [
                f"warning: the robot's poses are inverted, by the images of '{camera}': its board "
                f"is found {apart}, and with the inverses {length(after.metres)} apart; write these"
            ]
    return []


def _spreads(dataset: Dataset, observed: Observed) -> Dict[str, _Spread]:
    """Return how far apart the poses put the board that each camera sees most, where they tell."""
    found: Dict[str, _Spread] = {}
    for camera in dataset.sensors:
        try:
            views = hand_eye_views(dataset, camera, board_of(dataset, camera), observed=observed)
        except DatasetError:
            continue
        if len(views.G) < _FEWEST:
            continue
        X, metres = hand_eye_pose(views.G, views.H), np.inf
        if X is not None:
            places = np.array([(g @ X @ h)[:3, 3] for g, h in zip(views.G, views.H)])
            off = np.linalg.norm(places - places.mean(axis=0), axis=1)
            metres = float(np.sqrt(np.mean(off**2)))
        distance_m = float(np.median([np.linalg.norm(h[:3, 3]) for h in views.H]))
        found[camera] = _Spread(metres, metres / distance_m)
    return found
