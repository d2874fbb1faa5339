"""Errors summed up: what pooling, means and absent values mean."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from atom_core.evaluation.statistics import Errors, figures, mean_of, root_mean_square


def distances_only(*values):
    return Errors(np.array(values, dtype=float))


def test_the_root_mean_square_of_a_right_angle_s_legs():
    assert root_mean_square(np.array([3.0, 4.0])) == pytest.approx(5.0 / np.sqrt(2.0))


def test_the_root_mean_square_knows_no_sign_and_keeps_the_unit():
    values = np.array([-2.0, 2.0, -2.0])
    assert root_mean_square(values) == pytest.approx(2.0)
    assert root_mean_square(1000.0 * values) == pytest.approx(2000.0)


def test_absent_values_do_not_pull_a_mean_but_zeros_do():
    assert mean_of([None, 4.0, None, 8.0]) == 6.0
    assert mean_of([0.0, None, 8.0]) == 4.0


def test_the_mean_of_a_single_zero_is_zero_and_that_of_nothing_is_absent():
    assert mean_of([0.0]) == 0.0
    assert mean_of([None, None]) is None
    assert mean_of([]) is None


def test_offsets_become_their_lengths_and_stay_as_they_are():
    offsets_px = np.array([[3.0, -4.0], [0.0, 2.0]])
    errors = Errors.in_image(offsets_px, unseen=5)
    np.testing.assert_allclose(errors.distances, [5.0, 2.0])
    np.testing.assert_array_equal(errors.offsets, offsets_px)
    assert errors.unseen == 5
    assert errors.translation_mm is None and errors.rotation_deg is None


def test_unless_told_otherwise_everything_is_seen():
    assert Errors.in_image(np.zeros((2, 2))).unseen == 0
    assert distances_only(1.0).unseen == 0


def test_pooled_figures_count_every_item_once_however_parts_are_cut():
    values = np.array([1.0, 2.0, 4.0, 9.0])
    whole = figures([distances_only(*values)])
    cut = figures([distances_only(*values[:1]), distances_only(*values[1:])])
    assert whole == cut
    assert (whole.points, whole.mean, whole.median) == (4, 4.0, 3.0)
    assert whole.rms == pytest.approx(np.sqrt(102.0 / 4.0))


def test_parts_without_offsets_have_no_share_in_the_means_along_x_and_y():
    found = figures([distances_only(100.0), Errors.in_image(np.array([[-1.0, 2.0], [3.0, -6.0]]))])
    assert found.points == 3
    assert (found.x_mean_abs, found.y_mean_abs) == (2.0, 4.0)


def test_without_any_offsets_there_are_no_means_along_x_and_y():
    found = figures([distances_only(1.0)])
    assert found.x_mean_abs is None and found.y_mean_abs is None


def test_pose_differences_are_averaged_over_the_parts_that_have_them_not_over_items():
    found = figures(
        [
            Errors(np.ones(10), translation_mm=2.0, rotation_deg=0.5),
            Errors(np.ones(1), translation_mm=4.0, rotation_deg=1.5),
            Errors(np.ones(3)),
        ]
    )
    assert (found.translation_mm, found.rotation_deg) == (3.0, 1.0)


def test_figures_are_plain_numbers_that_json_can_hold():
    found = figures([Errors(np.ones(2), np.ones((2, 2)), translation_mm=1.0, rotation_deg=2.0)])
    kinds = {type(value) for name, value in vars(found).items() if name != "points"}
    assert kinds == {float} and type(found.points) is int


def test_errors_and_figures_stay_as_they_were_made():
    errors = distances_only(1.0)
    with pytest.raises(FrozenInstanceError):
        errors.unseen = 1
    with pytest.raises(FrozenInstanceError):
        figures([errors]).rms = 0.0
