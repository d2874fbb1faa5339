"""Moving parts: how far they may be off, and what is expected of their blocks."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.transforms import Edge
from atom_core.problem.moving_blocks import MOVING, MovingBlock, MovingPart

EDGE = Edge("base", "flange")


@pytest.mark.parametrize("sigma_m, sigma_rad", [(1e-12, 1.0), (1.0, 1e-12), (1e9, 1e9)])
def test_any_positive_spread_is_taken(sigma_m, sigma_rad):
    assert MovingPart(sigma_m, sigma_rad, {}).sigmas("000") == (sigma_m, sigma_rad)


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.inf, np.nan])
@pytest.mark.parametrize("place", [0, 1])
def test_a_spread_that_is_none_is_refused(wrong, place):
    sigmas = [0.01, 0.02]
    sigmas[place] = wrong
    with pytest.raises(ValueError, match="larger than 0, and finite"):
        MovingPart(*sigmas, {})


def test_a_part_that_is_far_is_as_good_as_free_in_that_collection_only():
    part = MovingPart(0.01, 0.02, {}, far=frozenset(["001"]))
    assert part.sigmas("000") == (0.01, 0.02)
    assert part.sigmas("001") == pytest.approx((100 * 0.01, 100 * 0.02))


def test_a_part_is_not_far_nor_estimated_unless_said():
    part = MovingPart(0.01, 0.02, {"000": np.eye(4)})
    assert not part.is_estimated and part.far == frozenset()


def test_a_part_does_not_change():
    with pytest.raises(FrozenInstanceError):
        MovingPart(0.01, 0.02, {}).sigma_m = 0.02


def test_parts_are_alike_whatever_the_dataset_says_of_their_places():
    assert MovingPart(0.01, 0.02, {"000": np.eye(4)}) == MovingPart(0.01, 0.02, {})
    assert MovingPart(0.01, 0.02, {}) != MovingPart(0.01, 0.03, {})


def test_a_block_is_expected_where_the_dataset_says():
    rng = np.random.default_rng(0)
    initial, given = (se3.random_move(0.5, 0.4, rng) for _ in range(2))
    block = MovingBlock(EDGE, MOVING, "000", ("flange",), initial, given, 0.01, 0.002)
    np.testing.assert_allclose(block.pose(block.prior_mean), given, atol=1e-12)
    np.testing.assert_allclose(block.prior_weight, [1 / 0.002**2] * 3 + [1 / 0.01**2] * 3)
    assert block.prior is None and block.without_prior() is block  # no knowledge of the user's
