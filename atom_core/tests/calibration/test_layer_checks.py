"""Layers of a LiDAR that read long and short by amounts of their own: named, with their size."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.refine.error_words import described
from atom_core.calibration.refine.model_errors import suggestion
from atom_core.problem.range_fields import LayerOffsets
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.realism import PLAIN


def with_rings(seed, sigma_m=0.008):
    realism = replace(PLAIN, ring_offset_sigma_m=sigma_m, sensors=("lidar_2",))
    return paper_cell(seed, realism=realism, disturbance=(0.05, 0.05))


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 10))]
)
def test_layers_that_differ_are_named_alone_with_their_size(seed):
    scene = with_rings(seed)
    (check,) = calibrate(scene.dataset).checks
    assert check.error == LayerOffsets("lidar_2")
    drawn = scene.planted.sensors["lidar_2"].ring_offsets_m
    assert check.value == pytest.approx(np.std(drawn), rel=0.2)
    assert suggestion(check).endswith("beside one another: --model_errors auto estimates it")


KINDS = ("paper_cell", "random_scene", "lidar_only", "two_patterns", "shared_edge")


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(8))
def test_forty_healthy_rigs_show_nothing(kind, seed):
    make = paper_cell if kind == "paper_cell" else getattr(scenes, kind)
    assert calibrate(make(seed).dataset).checks == ()


def test_a_range_offset_is_not_taken_for_layers_that_differ():
    realism = replace(PLAIN, lidar_offset_m=0.015, sensors=("lidar_2",))
    scene = paper_cell(2, realism=realism, disturbance=(0.05, 0.05))
    assert [check.error.kind for check in calibrate(scene.dataset).checks] == ["range_offset"]


@pytest.mark.long
def test_what_auto_has_estimated_is_not_named_again():
    result = calibrate(with_rings(0).dataset, CalibrationOptions(model_errors="auto"))
    assert result.status == "converged" and result.checks == ()


def test_the_sentence_has_the_size():
    said = described(LayerOffsets("lidar_1"), 0.008, 0.0002)
    assert said.startswith("the layers of lidar_1 read long and short by 8 +- 0.2 mm (RMS)")
