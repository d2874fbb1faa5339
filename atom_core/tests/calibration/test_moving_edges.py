"""Moving parts that are not where the dataset says: named, with how far they are off."""

import re
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.model.dataset import board_edge
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.mistakes import with_scaled_boards
from atom_core.synthetic.realism import PLAIN
from atom_core.synthetic.rig import jittered


def of_an_arm(seed, sigma_m, sigma_rad):
    realism = replace(PLAIN, moving_edge_sigma_m=sigma_m, moving_edge_sigma_rad=sigma_rad)
    return scenes.hand_eye(seed, collections=20, realism=realism)


def planted_sigmas(scene):
    """Return what was really drawn: one draw of sixty numbers is a tenth off its sigma."""
    off = [
        se3.inverse(true) @ scene.dataset.collections[key].transforms[edge]
        for (edge, key), true in scene.planted.moving.items()
    ]
    turns = np.array([se3.rotation_vector_from_rotation(m[:3, :3]) for m in off])
    shifts = np.array([m[:3, 3] for m in off])
    return np.sqrt(np.mean(shifts**2)), np.sqrt(np.mean(turns**2))


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_that_is_off_is_named_with_how_far(seed):
    scene = of_an_arm(seed, 0.003, 0.005)
    result = calibrate(scene.dataset)
    assert result.status == "inconsistent"
    assert result.message.startswith("the poses of 'flange' in 'rig_base' do not fit")
    (found,) = result.moving
    sigma_m, sigma_rad = planted_sigmas(scene)
    assert found.sigma_m == pytest.approx(sigma_m, rel=0.35)
    assert found.sigma_rad == pytest.approx(sigma_rad, rel=0.35)


@pytest.mark.parametrize("seed", range(4))
def test_boards_of_another_size_are_named_beside_an_arm_that_is_off(seed):
    """They were its poses alone, 12 mm off: of a real arm, whose print was 10 % larger, too."""
    scene = of_an_arm(seed, 0.003, 0.005)
    told = "as far as the data tell, board pattern_1 is "
    right = calibrate(scene.dataset)
    assert told not in right.message and right.status == "inconsistent"
    wrong = calibrate(with_scaled_boards(scene.dataset, 1.0 / 1.1))
    larger = re.search(f"{told}([0-9.]+) [+]- ([0-9.]+) % larger than described: m", wrong.message)
    value, sigma = (float(number) for number in larger.groups())
    assert abs(value - 10.0) < 3.0 * sigma and sigma < 3.0


@pytest.mark.parametrize("seed", range(4))
def test_a_millimetre_is_found_too(seed):
    scene = of_an_arm(seed, 0.001, 0.0)
    (found,) = calibrate(scene.dataset).moving
    assert found.sigma_m == pytest.approx(planted_sigmas(scene)[0], rel=0.35)


@pytest.mark.parametrize("seed", range(4))
def test_arms_that_are_where_they_say_are_not_named(seed):
    assert calibrate(scenes.hand_eye(seed, collections=20).dataset).moving == ()


def test_a_wrong_focal_length_is_not_the_arms_fault():
    scene = scenes.hand_eye(0, collections=20, realism=replace(PLAIN, focal_scale=0.02))
    result = calibrate(scene.dataset)
    assert result.moving == ()
    assert result.checks[0].error.name == "focal_length"


def test_where_nothing_moves_nothing_is_named():
    assert calibrate(paper_cell(0).dataset).moving == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_boards_that_are_held_stay_where_they_are_said_to_be(seed):
    scene = scenes.random_scene(seed, collections=12)
    edge, rng = board_edge(scene.dataset.patterns["pattern_1"]), np.random.default_rng(seed)
    said = {
        key: {edge: jittered(scene.truth.boards["pattern_1", key], 0.0005, 0.001, rng)}
        for key in scene.dataset.collections
    }
    held = scene.dataset.with_transforms(said)
    result = calibrate(held, CalibrationOptions(anchor_patterns=True))
    assert {block.kind for block in result.problem.parameters.blocks} == {"sensor"}
    for key, given in said.items():
        found = result.dataset.collections[key].transforms[edge]
        assert np.array_equal(found, given[edge])
