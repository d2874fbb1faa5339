"""What tests of trust checks ask: parts of a calibration, and stand-ins for its results."""

from types import SimpleNamespace

from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.trust import checks as module
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import Noise, scenes

BOARD = "pattern_1"
QUIET = CalibrationOptions(model_errors=OFF)


def quiet_dataset():
    """Return two cameras, the first one anchored, a depth camera and a LiDAR."""
    return scenes.random_scene(
        1, rgb=2, depth=1, lidar3d=1, collections=8, noise=Noise.none()
    ).dataset


def parts_of(whole, options=QUIET, known=None):
    return module._Parts(whole, options, known or {}, [])


def replaced(monkeypatch, **functions):
    for name, function in functions.items():
        monkeypatch.setattr(module, name, function)


def calibration_of(anchored=("rgb_1",), additional=(), dataset=None, unused=(), status=CONVERGED):
    free = SimpleNamespace(
        anchored_sensors=anchored, additional_tfs=dict.fromkeys(additional), priors={}
    )
    return SimpleNamespace(
        free=free,
        dataset=dataset,
        unused=dict.fromkeys(unused, "why"),
        status=status,
        problem="problem",
        summary=SimpleNamespace(x="x"),
    )
