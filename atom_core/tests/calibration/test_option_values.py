"""Numbers of options that mean nothing are refused where the options are made."""

import numpy as np
import pytest

from atom_core.calibration.options import CalibrationOptions
from atom_core.solvers.base import SolverOptions

NAN, INF = np.nan, np.inf


@pytest.mark.parametrize(
    "values, named",
    [
        ({"noisy_initial_guess": (NAN, 0.1)}, "noisy_initial_guess"),
        ({"noisy_initial_guess": (0.1, NAN)}, "noisy_initial_guess"),
        ({"noisy_initial_guess": (INF, 0.1)}, "noisy_initial_guess"),
        ({"undetermined_limit": (NAN, NAN)}, "undetermined_limit"),
        ({"undetermined_limit": (0.1, 0.0)}, "undetermined_limit"),
        ({"intrinsics_sigma": NAN}, "intrinsics_sigma"),
        ({"priors": {"edge": (NAN, 0.1)}}, "edge"),
        ({"moving_edge_sigma": {"flange": (0.1, NAN)}}, "flange"),
        ({"seed": -1}, "sample_seed"),
    ],
    ids=str,
)
def test_calibration_options(values, named):
    with pytest.raises(ValueError, match=named):
        CalibrationOptions(**values)


@pytest.mark.parametrize("iterations", [0, -1, 10**20])
def test_iterations(iterations):
    with pytest.raises(ValueError, match="max_iterations"):
        SolverOptions(max_iterations=iterations)


@pytest.mark.parametrize("divisor", [0.0, -1.0, np.nan, np.inf])
def test_a_multiplier_is_a_number_above_0(divisor):
    with pytest.raises(ValueError, match="-rnm"):
        SolverOptions(corner_divisor=divisor)
    assert SolverOptions(corner_divisor=0.5).corner_divisor == 0.5
