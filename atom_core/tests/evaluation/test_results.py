"""Figures of a pair: by row, by collection, their unweighted means, and all pooled."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from atom_core.evaluation.pairs import Pair, pair_kinds
from atom_core.evaluation.results import PairResult, summarised
from atom_core.evaluation.statistics import Errors


def of_size(size_px, count=1, **more):
    return Errors(np.full(count, float(size_px)), **more)


def test_each_collection_and_pattern_has_its_row_in_the_order_given():
    errors = {("b", "left"): of_size(1), ("a", "left"): of_size(2), ("b", "right"): of_size(3)}
    found = summarised(errors)
    assert [(row.collection, row.pattern) for row in found.rows] == list(errors)
    assert [row.figures.rms for row in found.rows] == [1.0, 2.0, 3.0]
    assert list(found.per_collection) == ["b", "a"]


def test_the_patterns_of_a_collection_are_pooled_item_by_item():
    found = summarised({("a", "left"): of_size(1, 3), ("a", "right"): of_size(5, 1)})
    assert found.per_collection["a"].points == 4
    assert found.per_collection["a"].mean == 2.0
    assert found.per_collection["a"].rms == pytest.approx(np.sqrt(28.0 / 4.0))


def test_collections_count_alike_in_the_mean_and_by_their_items_in_the_pool():
    found = summarised({("a", "board"): of_size(1, 9), ("b", "board"): of_size(3, 1)})
    assert found.rms == 2.0
    assert found.pooled.points == 10
    assert found.pooled.rms == pytest.approx(np.sqrt((9 * 1.0 + 9.0) / 10.0))


def test_two_patterns_of_one_collection_count_as_one_collection():
    """Collection a has an rms of sqrt(25) = 5 px, b has 1 px."""
    errors = {("a", "left"): of_size(1), ("a", "right"): of_size(7), ("b", "left"): of_size(1)}
    assert summarised(errors).rms == pytest.approx(3.0)


def test_parts_along_x_and_y_and_pose_differences_are_means_over_collections():
    errors = {
        ("a", "board"): Errors(
            np.ones(2), np.array([[1.0, -2.0], [3.0, 2.0]]), translation_mm=1.0, rotation_deg=4.0
        ),
        ("b", "board"): Errors(
            np.ones(1), np.array([[-6.0, 8.0]]), translation_mm=2.0, rotation_deg=8.0
        ),
    }
    found = summarised(errors)
    assert (found.x_mean_abs, found.y_mean_abs) == (4.0, 5.0)
    assert (found.x_std_abs, found.y_std_abs) == (0.5, 0.0)
    assert (found.translation_mm, found.rotation_deg) == (1.5, 6.0)


def test_what_a_metric_does_not_have_is_absent():
    found = summarised({("a", "board"): of_size(1)})
    names = ("x_mean_abs", "y_mean_abs", "x_std_abs", "y_std_abs")
    names += ("translation_mm", "rotation_deg")
    assert all(getattr(found, name) is None for name in names)


def test_perfect_items_have_an_error_of_zero():
    found = summarised({("a", "board"): of_size(0, 3)})
    assert (found.rms, found.pooled.rms) == (0.0, 0.0)


def test_a_result_has_nothing_unseen_or_unmeasured_unless_told():
    pair = Pair(pair_kinds()[0], "one", "other")
    first, second = PairResult(pair, None), PairResult(pair, None)
    assert first.unseen == 0 and first.unmeasured == {}
    assert first.at_truth is None and first.skipped is None
    assert first.unmeasured is not second.unmeasured


def test_results_stay_as_they_were_made():
    found = summarised({("a", "board"): of_size(1)})
    result = PairResult(Pair(pair_kinds()[0], "one", "other"), found)
    for made, name in ((result, "unseen"), (found, "rms"), (found.rows[0], "pattern")):
        with pytest.raises(FrozenInstanceError):
            setattr(made, name, 0)
