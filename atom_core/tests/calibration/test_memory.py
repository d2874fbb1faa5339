"""A calibration that would not fit is refused before anything is read, with the figures."""

import tracemalloc

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.prepare import memory
from atom_core.errors import CalibrationError
from atom_core.model.labels import RgbLabel
from atom_core.synthetic import Sampling, scenes

MACHINE = "MemTotal:  8000 kB\nMemFree:  1000 kB\nMemAvailable:  4000 kB\n"


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(0, collections=4).dataset


def machine(tmp_path, files):
    for name, text in {"proc/meminfo": MACHINE, **files}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return memory.available_bytes(tmp_path)


def test_what_the_machine_has_left(tmp_path):
    assert machine(tmp_path, {}) == 4000 * 1024


@pytest.mark.parametrize("group, at", [("/", ""), ("/a/b", "a/b/"), ("/a/b", "a/"), ("/a/b", "")])
def test_the_tightest_control_group_counts(tmp_path, group, at):
    files = {
        "proc/self/cgroup": f"0::{group}\n",
        f"sys/fs/cgroup/{at}memory.max": "1500000\n",
        f"sys/fs/cgroup/{at}memory.current": "500000\n",
    }
    assert machine(tmp_path, files) == 1000000


def test_control_groups_of_the_first_kind(tmp_path):
    files = {
        "proc/self/cgroup": "5:cpu:/x\n4:memory:/x\n",
        "sys/fs/cgroup/memory/x/memory.limit_in_bytes": "1500000\n",
        "sys/fs/cgroup/memory/x/memory.usage_in_bytes": "1400000\n",
    }
    assert machine(tmp_path, files) == 100000


@pytest.mark.parametrize("limit", ["max", str((1 << 63) - 4096)])
def test_a_group_without_a_limit_is_none(tmp_path, limit):
    files = {
        "proc/self/cgroup": "0::/\n",
        "sys/fs/cgroup/memory.max": limit,
        "sys/fs/cgroup/memory.current": "500000\n",
    }
    assert machine(tmp_path, files) == 4000 * 1024


def test_where_nobody_tells_nothing_is_refused(tmp_path, dataset, monkeypatch):
    assert memory.available_bytes(tmp_path) is None
    monkeypatch.setattr(memory, "available_bytes", lambda: None)
    memory.check_memory(dataset, "ceres")


def test_too_little_is_refused_with_figures_and_remedy(dataset, monkeypatch):
    def no_reading(*_):
        raise AssertionError("data are read although the memory does not suffice")

    monkeypatch.setattr(memory, "available_bytes", lambda: 100_000)
    monkeypatch.setattr(type(dataset.data), "read", no_reading)
    with pytest.raises(CalibrationError, match=r"needs about \d+ MB .* 0 MB are available; .*-csf"):
        calibrate(dataset)


def test_the_user_may_insist_or_set_the_limit(dataset, monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 100_000)
    monkeypatch.setenv(memory.LIMIT_VARIABLE, "0")
    memory.check_memory(dataset, "ceres")
    monkeypatch.setenv(memory.LIMIT_VARIABLE, "1e6")
    memory.check_memory(dataset, "ceres")
    monkeypatch.setenv(memory.LIMIT_VARIABLE, "0.01")
    with pytest.raises(CalibrationError, match="0 MB are available"):
        memory.check_memory(dataset, "ceres")
    monkeypatch.setenv(memory.LIMIT_VARIABLE, "lots")
    with pytest.raises(CalibrationError, match="no number"):
        memory.check_memory(dataset, "ceres")


def test_the_estimate_grows_with_labels_and_solver(dataset):
    half = dataset.selected(collections=list(dataset.collections)[:2])
    whole, scipy = (memory.estimated_bytes(dataset, name) for name in ("ceres", "scipy"))
    assert memory.estimated_bytes(half, "ceres") < whole < scipy


def with_a_wrong_label(dataset, key, place):
    """Return the dataset in which a camera's corners in one collection are elsewhere."""
    label = dataset.collections[key].labels[place]
    moved = RgbLabel(label.ids, label.pixels + np.array([60.0, -25.0]))
    return dataset.with_labels(key, {place: moved})


@pytest.mark.parametrize(("depth", "lidar3d"), [(1, 0), (0, 2)])
def test_the_estimate_is_no_less_than_what_is_taken_and_not_far_more(dataset, depth, lidar3d):
    """Of a calibration that leaves a detection out, which solves two problems."""
    calibrate(dataset)  # what is loaded once does not count
    sampling = Sampling(10**9, labeled_only=True)
    sensors = {"rgb": 2, "depth": depth, "lidar3d": lidar3d}
    scene = scenes.random_scene(
        1, **sensors, collections=24, sampling=sampling, disturbance=(0.03, 0.03)
    ).dataset
    place = ("rgb_2", "pattern_1")
    key = next(key for key, c in scene.collections.items() if len(c.labels) == len(scene.sensors))
    wrong = with_a_wrong_label(scene, key, place)
    tracemalloc.start(1)
    result = calibrate(wrong)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [(r.key.collection, r.key.sensor) for r in result.rejected] == [(key, "rgb_2")]
    assert taken < memory.estimated_bytes(wrong, "ceres") < 4 * taken
