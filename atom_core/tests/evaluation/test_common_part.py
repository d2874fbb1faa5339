"""Two clouds over the part of a board that both see."""

import numpy as np
import pytest

from atom_core.evaluation.common_part import in_outline
from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.synthetic import Noise, paper_cell

COMMON, NEAREST = "lidar3d-lidar3d_common", "lidar3d-lidar3d"


def grid(width_m, height_m, step_m=0.02, gap_m=0.08):
    """Return points of layers ``gap_m`` apart."""
    x, y = np.meshgrid(np.arange(0, width_m, step_m), np.arange(0, height_m, gap_m))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def test_the_outline_is_grown_by_one_step_of_the_beams():
    others = grid(0.41, 0.41)  # up to x = 0.40
    points = np.array([[0.2, 0.2, 0.5], [0.415, 0.2, 0.0], [0.425, 0.2, 0.0], [0.2, -0.03, 0.0]])
    assert list(in_outline(points, others)) == [True, True, False, False]
    turn = se3.random_move(1.0, 2.0, np.random.default_rng(0))
    moved = [se3.apply(turn, part) for part in (points, others)]
    assert list(in_outline(*moved)) == [True, True, False, False]


def test_a_line_has_no_outline():
    line = np.outer(np.arange(5.0), [0.1, 0.0, 0.0])
    assert not in_outline(grid(0.2, 0.2), line).any()


@pytest.fixture(scope="module")
def exact():
    return paper_cell(3, "test", Noise.none()).dataset


def by_pair(dataset, train=None):
    found = evaluate(train or dataset, dataset, pairs=["lidar_*:lidar_*"])
    return {(r.pair.kind.name, r.pair.source, r.pair.target): r for r in found.pairs}


def test_what_one_of_them_does_not_see_does_not_count(exact):
    results = by_pair(exact)
    common = [r for (kind, *_), r in results.items() if kind == COMMON]
    assert len(common) == 3 and all(r.measured for r in common)
    for result in common:
        names = (result.pair.source, result.pair.target)
        whole = results[(NEAREST, *names)].measured
        assert result.measured.rms < whole.rms
        assert result.measured.pooled.points < whole.pooled.points
        assert result.measured.rms < 35.0  # gaps of the layers, at the truth


def test_it_judges_no_calibration_and_says_why(exact):
    for (kind, *_), result in by_pair(exact).items():
        if kind == COMMON:
            assert "hardly any along it" in result.pair.kind.floor
