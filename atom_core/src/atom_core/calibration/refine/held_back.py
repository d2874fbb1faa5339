"""What a prior holds back against the data: then what is expected is not what is there."""

from __future__ import annotations

from typing import Dict, List, Mapping

import numpy as np

from atom_core.problem.camera_blocks import PINHOLE, ExpectedCamera
from atom_core.problem.parameters import Parameters
from atom_core.solvers.covariance import Covariance

STRONG = 3.0  # standard deviations by which data pull a number from where it is expected
_LEAST_TOLD = 0.1  # part of its prior by which data move a number, to tell anything of it


def pull_sigma(expected: float, of_model: float, sigma: float) -> float:
    """Return how far an estimate is usually pulled away from where its prior has it, by data.

    What the data tell in part follows them in part: an estimate at twice what is usual, and sure
    to no more than that, means that they have it far beyond.

    Args:
        expected: standard deviation of the prior.
        of_model: of the estimate, as the noise has it.
        sigma: likewise, as the collections have it.
    """
    variance = expected**2 - of_model**2 + max(sigma**2 - of_model**2, 0.0)
    return float(np.sqrt(np.clip(variance, (_LEAST_TOLD * expected) ** 2, expected**2)))


def cameras_held_back(
    parameters: Parameters, x: np.ndarray, covariance: Covariance
) -> Dict[str, float]:
    """Return the cameras of which the corners contradict what is expected, and how far off it is.

    In parts of the focal length, as the corners alone would have the worst of the focal lengths and
    the centre.

    Args:
        parameters: of the problem.
        x: its solution.
        covariance: of the parameters, as the noise has it.
    """
    off = np.abs(parameters.by_block(x) - parameters.prior_mean)
    found: Dict[str, float] = {}
    for i, block in parameters.camera_blocks():
        if block.expected is None:
            continue
        expected, sigmas = block.expected.sigma, np.sqrt(np.diagonal(covariance.block(i)))
        for place, name in block.free_components:
            pull = pull_sigma(expected, sigmas[place], sigmas[place])
            if name in PINHOLE and off[i, place] > max(STRONG * pull, expected):
                by_corners = float(off[i, place]) * (expected / pull) ** 2
                found[block.sensor] = max(found.get(block.sensor, 0.0), by_corners)
    return found


def held_back_in_words(
    held_back: Mapping[str, float], expected: Mapping[str, ExpectedCamera]
) -> List[str]:
    """Return a sentence for each camera that was given more room than was expected."""
    return [
        f"camera '{name}': its corners put focal length or centre {100.0 * off:.2g} % of the focal "
        f"length from what is given, {off / expected[name].sigma:.2g} times what is expected: it "
        f"is taken to be as far off as that (--intrinsics_sigma {100.0 * off:.2g}); look whether "
        f"its camera_info is of these images, and whether the board has the size that is configured"
        for name, off in held_back.items()
    ]
