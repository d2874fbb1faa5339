"""The compiled module: found when built, named with its remedy when not; its functions' laws."""

import subprocess
import sys

import numpy as np
import pytest

from atom_core import native
from atom_core.errors import NativeModuleError


def test_absence_names_feature_and_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "atom_core._core", None)
    assert not native.available()
    with pytest.raises(NativeModuleError) as error:
        native.require("Reading a robot description")
    message = str(error.value)
    assert message.startswith("Reading a robot description needs the compiled module")
    assert "make build" in message and "catkin_make" in message and "source env.bash" in message
    assert "\n" not in message


def test_a_module_that_cannot_be_loaded_says_why(monkeypatch):
    def refuse(name):
        raise ImportError("liburdfdom_model.so: cannot open shared object file")

    monkeypatch.setattr(native.importlib, "import_module", refuse)
    assert not native.available()
    with pytest.raises(NativeModuleError, match="cannot be loaded .*liburdfdom_model.*make build"):
        native.require("Calibrating")


def test_descriptions_import_without_the_compiled_module():
    code = (
        "import sys; sys.modules['atom_core._core'] = None\n"
        "import atom_core, atom_core.model.robot, atom_core.io.urdf, atom_core.native\n"
        "assert not atom_core.native.available()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


WITHOUT_IT = """
import sys
sys.modules["atom_core._core"] = None
from atom_core import cli
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

write_dataset_folder(scenes.random_scene(1, collections=8).dataset, "data", name="rig")
data, calibrated = "data/dataset.json", "results/atom_calibration.json"
assert cli.main(["check", "--dataset", data]) == 0
assert cli.main(["calibrate", "--dataset", data, "--output", "results", "--no_report"]) == 0
words = ["--train", calibrated, "--test", data, "--output", "evaluation", "--no_report"]
assert cli.main(["evaluate", *words]) == 0
"""


def test_a_dataset_is_calibrated_and_evaluated_where_nothing_is_built(tmp_path):
    command = [sys.executable, "-c", WITHOUT_IT]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Checking how large boards look in clouds needs" in done.stdout + done.stderr
    assert '"name": "scipy"' in (tmp_path / "results" / "calibration.json").read_text()


def test_the_module_is_built():
    """Fails, and says what to do, where the tests of the compiled parts cannot run."""
    native.require("The test suite")


def make_board(n, distance, seed):
    """Return points (n, 3) [m] with noise on a board far off, weights (n,) and a plane (4,)."""
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(3)
    centre = distance * direction / np.linalg.norm(direction)
    points = centre + np.c_[rng.uniform(-0.5, 0.5, (n, 2)), 0.005 * rng.standard_normal(n)]
    normal = np.array([0.01, -0.02, 1.0]) / np.linalg.norm([0.01, -0.02, 1.0])
    return points, rng.uniform(50.0, 200.0, n), np.r_[normal, -normal @ centre + 0.003]


@pytest.mark.parametrize("distance", [0.5, 10.0, 100.0])
def test_compressed_rows_keep_the_cost(distance):
    core = native.require("Compression")
    points, weights, plane = make_board(3000, distance, seed=1)
    rows = core.compress_planar_rows(points, weights)
    assert rows.shape == (4, 4)
    exact = weights.astype(np.longdouble) * (points.astype(np.longdouble) @ plane[:3] + plane[3])
    assert np.sum((rows @ plane) ** 2) == pytest.approx(float(exact @ exact), rel=1e-12)


def test_compressed_rows_keep_the_cost_of_every_plane():
    core = native.require("Compression")
    points, weights, _ = make_board(100, 3.0, seed=2)
    matrix = np.c_[weights[:, None] * points, weights]
    rows = core.compress_planar_rows(points, weights)
    np.testing.assert_allclose(rows.T @ rows, matrix.T @ matrix, rtol=1e-12)


def test_segments_are_the_single_sets_filled_with_zeros():
    core = native.require("Compression")
    points, weights, _ = make_board(20, 3.0, seed=3)
    blocks = core.compress_planar_segments(points, weights, [0, 3, 3])
    assert blocks.shape == (3, 4, 4)
    np.testing.assert_array_equal(blocks[0, :3], core.compress_planar_rows(points[:3], weights[:3]))
    np.testing.assert_array_equal(blocks[0, 3], np.zeros(4))
    np.testing.assert_array_equal(blocks[1], np.zeros((4, 4)))
    np.testing.assert_array_equal(blocks[2], core.compress_planar_rows(points[3:], weights[3:]))


def test_any_memory_layout_gives_the_same_rows():
    core = native.require("Compression")
    points, weights, _ = make_board(20, 3.0, seed=4)
    expected = core.compress_planar_rows(points, weights)
    np.testing.assert_array_equal(
        core.compress_planar_rows(np.asfortranarray(points), np.repeat(weights, 2)[::2]), expected
    )


@pytest.mark.parametrize(
    "points, weights, starts",
    [
        (np.zeros((3, 2)), np.zeros(3), [0]),
        (np.zeros(3), np.zeros(3), [0]),
        (np.zeros((3, 3)), np.zeros(2), [0]),
        (np.zeros((3, 3)), np.zeros((3, 1)), [0]),
        (np.full((3, 3), np.nan), np.zeros(3), [0]),
        (np.zeros((3, 3)), np.full(3, np.inf), [0]),
        (np.zeros((3, 3)), np.zeros(3), [1]),
        (np.zeros((3, 3)), np.zeros(3), [0, 2, 1]),
        (np.zeros((3, 3)), np.zeros(3), [0, 4]),
        (np.zeros((3, 3)), np.zeros(3), []),
        (np.zeros((3, 3)), np.zeros(3), [[0]]),
    ],
)
def test_malformed_input_is_a_value_error(points, weights, starts):
    core = native.require("Compression")
    with pytest.raises(ValueError):
        core.compress_planar_segments(points, weights, np.array(starts, dtype=np.int64))


@pytest.mark.parametrize("beam, dark", [(np.inf, 0), (np.nan, 0), (-1, 0), (4, 0), (0, np.inf)])
def test_a_beam_is_narrow_and_a_square_has_a_size(beam, dark):
    core = native.require("Boards")
    scan = core.find_layers(np.ones((4, 3)), np.zeros(0, np.int64), 4, 1)
    with pytest.raises(ValueError):
        core.segment_board(scan, np.ones(3), 1.0, 1.0, 3, beam, dark)
    with pytest.raises(ValueError):
        core.find_boards(scan, 1.0, 1.0, 3, beam, dark)


def test_layers_of_fewer_points_than_the_cloud_has_are_a_value_error():
    core = native.require("Boards")
    scan = core.find_layers(np.ones((4, 3)), np.zeros(0, np.int64), 4, 1)
    assert len(scan.layer_of_points(4)) == 4
    for size in (3, 0, -1):
        with pytest.raises(ValueError, match="number of the cloud's points"):
            scan.layer_of_points(size)


def test_every_function_is_documented():
    core = native.require("Documentation")
    for name in ("parse_urdf", "compress_planar_rows", "compress_planar_segments"):
        assert "Returns:" in getattr(core, name).__doc__
