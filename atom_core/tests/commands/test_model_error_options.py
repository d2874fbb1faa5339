"""What the options of ``calibrate`` about moving parts select, and what they refuse."""

import argparse

import numpy as np
import pytest

from atom_core.commands.model_error_options import (
    add_model_error_options,
    selected_moving_edges,
)
from atom_core.errors import CalibrationError
from atom_core.synthetic import paper_cell, scenes


@pytest.fixture(scope="module")
def dataset():
    return scenes.hand_eye(0, collections=4).dataset


def selected(dataset, *words):
    parser = argparse.ArgumentParser()
    add_model_error_options(parser)
    return selected_moving_edges(parser.parse_args(words), dataset)


def test_without_figures_it_is_estimated_and_without_names_it_is_of_all_that_move(dataset):
    assert selected(dataset) == {}
    assert selected(dataset, "--moving_edge_sigma") == {"flange": None}
    assert selected(dataset, "--moving-edge-sigma", "fl*") == {"flange": None}


def test_figures_are_millimetres_and_degrees(dataset):
    (sigmas,) = selected(dataset, "--moving_edge_sigma", "flange", "1", "0.1").values()
    assert sigmas == pytest.approx((0.001, np.radians(0.1)))
    assert selected(dataset, "--moving_edge_sigma", "1", "0.1") == {"flange": sigmas}


def test_it_can_be_given_for_several_parts(dataset):
    words = ["--moving_edge_sigma", "flange", "1", "0.1", "--moving_edge_sigma", "pan"]
    assert selected(dataset, *words)["pan"] is None


@pytest.mark.parametrize(
    "words",
    [["1"], ["flange", "1"], ["flange", "1", "x"], ["flange", "-1", "0.1"], ["flange", "1", "0"]]
    + [["flange", "nan", "0.1"], ["flange", "1", "inf"], ["1", "0.1", "flange"], ["1", "2", "3"]],
)
def test_other_figures_are_refused(dataset, words):
    with pytest.raises(CalibrationError, match="it needs two figures > 0, mm and deg"):
        selected(dataset, "--moving_edge_sigma", *words)


def test_where_nothing_moves_that_is_said():
    with pytest.raises(CalibrationError, match="nothing moves between a sensor and a board"):
        selected(paper_cell(0).dataset, "--moving_edge_sigma")
