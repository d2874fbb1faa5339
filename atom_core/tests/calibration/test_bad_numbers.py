"""Numbers that no solver can use end in a sentence that names them, with either solver."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core import native
from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.errors import CalibrationError
from atom_core.model.labels import RgbLabel
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
    return scenes.random_scene(0, collections=5, disturbance=(0.02, 0.02)).dataset


def solved(dataset, name, **solver):
    options = CalibrationOptions(solver=SolverOptions(**solver), solver_name=name)
    return calibrate(dataset, options)


def with_label(dataset, collection, sensor, change):
    found = dataset.collections[collection]
    labels = dict(found.labels)
    labels[(sensor, "pattern_1")] = change(labels[(sensor, "pattern_1")])
    changed = replace(found, labels=labels)
    return replace(dataset, collections={**dataset.collections, collection: changed})


def with_pixel(dataset, value):
    def change(label):
        pixels = label.pixels.copy()
        pixels[3, 1] = value
        return RgbLabel(label.ids, pixels)

    return with_label(dataset, "002", "rgb_1", change)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
@pytest.mark.parametrize("name", NAMES)
def test_a_residual_that_is_not_finite_is_named(dataset, name, value):
    corner = dataset.collections["002"].labels[("rgb_1", "pattern_1")].ids[3]
    with pytest.raises(CalibrationError) as error:
        solved(with_pixel(dataset, value), name)
    for word in ("'rgb_1'", "collection 002", f"corner {corner} ", "not finite", "-csf"):
        assert word in str(error.value)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", NAMES)
def test_an_absurd_but_finite_range_does_not_crash(dataset, name):
    data, label = dataset.data, dataset.collections["001"].labels[("lidar_1", "pattern_1")]
    cloud = data.read("001", "lidar_1").copy()
    cloud[label.indices[5]] *= 1e7
    result = solved(replace(dataset, data=Changed(data, ("001", "lidar_1"), cloud)), name)
    assert result.message and np.all(np.isfinite(result.summary.x))


class Changed:
    """Another data source with one cloud replaced."""

    def __init__(self, source, key, cloud):
        self.source, self.key, self.changed = source, key, cloud

    def read(self, *key):
        return self.changed if key == self.key else self.source.read(*key)

    def __getattr__(self, name):
        return getattr(self.source, name)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("loss", ["none", "huber", "cauchy"])
@pytest.mark.parametrize("name", NAMES)
def test_an_absurd_but_finite_pixel_does_not_crash(dataset, name, loss):
    result = solved(with_pixel(dataset, 1e7), name, loss=loss)
    assert np.all(np.isfinite(result.summary.x))
    if loss == "cauchy":
        assert result.status == "converged"


def one_corner(label):
    return RgbLabel(label.ids[:1], label.pixels[:1])


@pytest.mark.parametrize("weights", ["sigma", "atom"])
@pytest.mark.parametrize("name", NAMES)
def test_a_singular_system_is_an_answer_with_a_status(name, weights):
    thin = scenes.two_cameras(0, collections=4).dataset
    for collection, found in thin.collections.items():
        if ("rgb_2", "pattern_1") in found.labels:
            thin = with_label(thin, collection, "rgb_2", one_corner)
    result = solved(thin, name, weights=weights)
    assert result.status in ("rank_deficient", "not_converged", "failed")
    assert result.message and np.all(np.isfinite(result.summary.x))
    assert all(np.isfinite(w.sigma) for w in result.weak_directions)


@pytest.mark.parametrize("name", NAMES)
def test_no_detection_at_all_is_refused(dataset, name):
    empty = {k: replace(c, labels={}) for k, c in dataset.collections.items()}
    with pytest.raises(CalibrationError, match="no detection"):
        solved(replace(dataset, collections=empty), name)
