"""The beams of the LiDAR models: layers, columns, fields of view, and their labels in a scene."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic import ROUGH, LidarModel, Noise, charuco, make_dataset
from atom_core.synthetic.lidar import beams_on_board
from atom_core.synthetic.lidar_models import LIDAR_MODELS, lidar_model
from atom_core.synthetic.rig import assemble, lidar_mount
from atom_core.synthetic.sensing import planted_in

PATTERN = pattern_from_config("pattern_1", charuco())
FACING = se3.from_rpy(np.array([1.6, 0.36, 0.27]), np.array([-np.pi / 2, 0.0, -np.pi / 2]))
HELD = se3.from_rpy(np.array([0.0, 0.0, 1.2]), np.zeros(3))
LAYERED = [name for name, model in LIDAR_MODELS.items() if model.has_layers]


@pytest.mark.parametrize("name", LIDAR_MODELS)
def test_directions_have_unit_length_and_belong_to_their_ring(name):
    model = LIDAR_MODELS[name]
    beams = model.directions
    assert len(beams) == model.rings * model.azimuth_steps
    np.testing.assert_allclose(np.linalg.norm(beams, axis=1), 1.0, atol=1e-12)
    assert not beams.flags.writeable
    if model.has_layers:
        elevation = np.degrees(np.arcsin(beams[:, 2])).reshape(model.rings, -1)
        assert np.ptp(elevation, axis=1).max() < 1e-9
        assert np.all(np.diff(elevation[:, 0]) > 0.3)
        assert (elevation[0, 0], elevation[-1, 0]) == pytest.approx(
            (model.elevation_deg[0], model.elevation_deg[-1])
        )


def test_the_beams_of_an_ouster_column_are_staggered_and_those_of_a_velodyne_are_not():
    for name in LAYERED:
        model = LIDAR_MODELS[name]
        x, y, _ = model.directions.reshape(model.rings, -1, 3)[:, model.azimuth_steps // 2].T
        azimuth_deg = np.degrees(np.arctan2(y, x))
        expected = np.resize(model.stagger_deg or (0.0,), model.rings)
        np.testing.assert_allclose(azimuth_deg - azimuth_deg.mean(), expected, atol=1e-9)
        assert bool(model.stagger_deg) is name.startswith("ouster")


@pytest.mark.parametrize("name", sorted(set(LIDAR_MODELS) - set(LAYERED)))
def test_a_model_without_layers_looks_ahead(name):
    model = LIDAR_MODELS[name]
    azimuth = np.degrees(np.arctan2(model.directions[:, 1], model.directions[:, 0]))
    assert np.max(np.abs(azimuth)) == pytest.approx(model.field_deg / 2.0, rel=0.01)
    assert model.directions[:, 0].min() > 0.7


def test_a_rosette_does_not_repeat_itself():
    beams = LIDAR_MODELS["livox"].directions
    assert len(np.unique(np.round(beams, 5), axis=0)) > 0.99 * len(beams)


@pytest.mark.parametrize("name", LIDAR_MODELS)
def test_a_scene_labels_points_of_the_board_and_its_border(name):
    model = LIDAR_MODELS[name]
    rig = assemble("world", {}, [lidar_mount("lidar_1", "world", HELD, model)])
    planted = planted_in(rig, ["pattern_1"], ROUGH, [3])
    assert len(planted.of("lidar_1").ring_offsets_m) == (model.rings if model.has_layers else 0)
    world_T_lidar = rig.pose("lidar_1")
    poses = {"pattern_1": [world_T_lidar @ FACING]}
    from_scene = make_dataset(rig, poses, Noise.none(), np.random.default_rng(0))
    label = from_scene.dataset.collections["000"].labels[("lidar_1", "pattern_1")]
    beams, _ = beams_on_board(model, FACING, PATTERN)
    assert len(label.indices) == len(beams) > 100
    points = from_scene.dataset.data.read("000", "lidar_1")
    inside = [
        -PATTERN.border.signed_distance(se3.apply(se3.inverse(FACING), points[i])[:, :2])[0]
        for i in (label.indices, label.limit_indices)
    ]
    assert inside[0].min() >= -1e-9
    assert 10 < len(inside[1]) < 0.5 * len(inside[0])
    if not model.has_layers:
        assert inside[1].max() < 0.03 < inside[0].max()


def test_unknown_names_and_uneven_numbers_are_refused():
    with pytest.raises(ValueError, match="'vlp16' is unknown; use vlp_16, hdl_32"):
        lidar_model("vlp16")
    with pytest.raises(ValueError, match="elevation_deg has 3 numbers"):
        LidarModel(elevation_deg=(-1.0, 0.0, 1.0))
