"""Live views of a solve, and Ctrl-C: both solvers alike."""

import json
import signal
import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest

from atom_core import native
from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.solvers.base import SolverOptions
from atom_core.synthetic import scenes

NAMES = [
    pytest.param(
        "ceres", marks=pytest.mark.skipif(not native.available(), reason="native module not built")
    ),
    "scipy",
]


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(0, collections=6, disturbance=(0.1, 0.1)).dataset


def calibrated(dataset, name, progress):
    options = SolverOptions(progress=progress)
    return calibrate(dataset, CalibrationOptions(solver=options, solver_name=name))


@pytest.mark.parametrize("name", NAMES)
def test_progress_tells_of_every_iteration(dataset, name):
    seen = []

    def note(iteration):
        seen.append((iteration.number, iteration.cost, iteration.edges()))

    result = calibrated(dataset, name, note)
    numbers, costs, edges = zip(*seen)
    assert result.status == "converged"
    assert numbers[0] == 0 and all(0 <= b - a <= 1 for a, b in zip(numbers, numbers[1:]))
    assert numbers[-1] <= result.summary.iterations
    assert costs[0] > costs[1] > 0
    solved = next(iter(result.dataset.collections.values())).transforms
    assert edges[-1]
    for edge, pose in edges[-1].items():
        np.testing.assert_allclose(pose, solved[edge], atol=1e-4)
    assert any(not np.allclose(pose, edges[0][edge]) for edge, pose in edges[-1].items())


@pytest.mark.parametrize("name", NAMES)
def test_an_error_in_it_reaches_the_caller(dataset, name):
    def fail(iteration):
        if iteration.number == 3:
            raise LookupError("the view is gone")

    with pytest.raises(LookupError, match="the view is gone"):
        calibrated(dataset, name, fail)


@pytest.mark.parametrize("after", [0, 2, 7])
@pytest.mark.parametrize("name", NAMES)
def test_false_stops_with_the_best_state(dataset, name, after):
    costs = []

    def stop(iteration):
        costs.append(iteration.cost)
        return iteration.number < after

    result = calibrated(dataset, name, stop)
    assert result.status == "not_converged"
    assert result.message.startswith("interrupted")
    assert result.summary.iterations == after
    assert (result.summary.cost_final < result.summary.cost_initial) == (after > 0)


@pytest.mark.parametrize(("after", "state"), [(2, "best state so far"), (12, "start is kept")])
@pytest.mark.parametrize("name", NAMES)
def test_interrupted_far_from_any_answer_it_says_so_and_blames_no_data(name, after, state):
    """A lens that bends everything: the weights change meanwhile, and the start was better."""
    scene = scenes.random_scene(2, collections=4, disturbance=(0.1, 0.1))
    sensors = dict(scene.dataset.sensors)
    camera = replace(sensors["rgb_1"].camera, D=np.array([1e3, 0.0, 0.0, 0.0, 0.0]))
    sensors["rgb_1"] = replace(sensors["rgb_1"], camera=camera)
    dataset = replace(scene.dataset, sensors=sensors)
    result = calibrated(dataset, name, lambda iteration: iteration.number < after)
    assert (result.status, result.summary.iterations) == ("not_converged", after)
    assert result.message.startswith(f"interrupted after {after} iterations")
    assert state in result.message
    verdict = calibration_verdict(calibration_results(result, name))
    for sensor in verdict.sensors.values():
        assert sensor.grade == "wrong" and sensor.advice == "let the solver end"


INTERRUPTED = """
    import signal, sys
    from atom_core.cli import main
    from atom_core.solvers.{module} import {solver} as Solver

    minimise = Solver.minimise

    def waiting(self, x, sigmas, loss, limit, tolerance, progress):
        def told(iteration, cost, now):
            if iteration == 4:
                print("at 4", file=sys.stderr, flush=True)
                sys.stdin.readline()  # until the test has sent the signal
            return progress(iteration, cost, now)
        return minimise(self, x, sigmas, loss, limit, tolerance, told)

    Solver.minimise = waiting
    sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope="module")
def dataset_file(dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("interrupted") / "dataset"
    return write_dataset_folder(dataset, folder, name="interrupted")


def interruptible():
    """Background jobs of a shell ignore SIGINT, and so would their children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize(
    "name, module, solver",
    [
        ("ceres", "ceres_solver", "CeresSolver"),
        ("scipy", "levenberg_marquardt", "LevenbergMarquardt"),
    ],
)
def test_ctrl_c_ends_the_command_with_results(dataset_file, tmp_path, name, module, solver):
    if name == "ceres" and not native.available():
        pytest.skip("native module not built")
    program = textwrap.dedent(INTERRUPTED.format(module=module, solver=solver))
    arguments = [
        "calibrate",
        "--dataset",
        str(dataset_file),
        "--output",
        str(tmp_path / "out"),
        "--solver",
        name,
    ]
    running = subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )
    try:
        assert running.stderr.readline() == "at 4\n"
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate("go on\n", timeout=300)
    finally:
        running.kill()
    assert running.returncode == 1, errors
    assert "Traceback" not in errors
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert document["status"] == "not_converged"
    assert document["message"].startswith("interrupted after 4 iterations")
    assert document["solver"]["cost_final"] < document["solver"]["cost_initial"]
    assert (tmp_path / "out" / "atom_calibration.json").exists()
