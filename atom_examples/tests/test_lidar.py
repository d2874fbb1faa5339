import cell_boards as boards
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.synthetic.lidar import beams_on_board
from atom_core.synthetic.lidar_models import LIDAR_MODELS
from atom_examples.cell_simulator.devices import Packing, devices_of
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.still import WhileStill
from atom_examples.cell_simulator.world import World


@pytest.fixture(params=["lidar_1", "lidar_2", "lidar_3"])
def view(world, request):
    """A board below a LiDAR; device, scene and ``lidar_T_pattern``."""
    device, scene = world.lidars[request.param], world.scene
    middle, eye = np.array([0.1, -0.4, 1.0]), scene.pose(device.frame)[:3, 3]
    away = (middle - eye) / np.linalg.norm(middle - eye)
    x = np.cross(away, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(away, x), away])
    rotation = rotation @ se3.rotation_from_rpy(np.array([0.3, -0.2, 0.5]))
    pattern = scene.board.pattern
    scene.place_person(boards.AWAY)
    scene.place_board(
        se3.transform(rotation, middle - rotation @ np.append(pattern.border.centre, 0.0))
    )
    return device, scene, se3.inverse(scene.pose(device.frame)) @ scene.world_T_pattern


def test_ranges_on_the_board_are_exact_without_noise(world, view):
    device, scene, lidar_T_pattern = view
    scan = device.capture(scene)
    beams, ranges = beams_on_board(device.model, lidar_T_pattern, scene.board.pattern)
    on_plate = scan.beam[scan.on_plate]
    # All but beams on the plate's 1 mm rim, which the flat board does not have.
    assert len(np.setxor1d(on_plate, beams)) <= 3
    both, first, second = np.intersect1d(on_plate, beams, return_indices=True)
    measured = np.linalg.norm(scan.points[scan.on_plate][first].astype(float), axis=1)
    assert len(both) > 150
    assert np.max(np.abs(measured - ranges[second])) <= 1e-4


def test_a_board_that_moves_is_seen_as_if_all_were_cast_anew(world, view):
    device, scene, _ = view
    kept = device.capture(scene)
    device._still, device._walls = WhileStill(), None
    anew = device.capture(scene)
    assert np.array_equal(kept.points, anew.points)
    pose = scene.pose(device.frame)
    hits = scene.cast(pose[:3, 3], device.model.directions @ pose[:3, :3].T)
    in_range = (hits.distance >= 0.3) & (hits.distance <= 130.0)
    assert np.array_equal(np.flatnonzero(in_range), anew.beam)
    measured = np.linalg.norm(anew.points.astype(float), axis=1)
    np.testing.assert_allclose(measured, hits.distance[in_range], atol=1e-5)


def test_noise_and_lost_returns_are_those_of_the_settings(view):
    device, scene, _ = view
    assert (device.noise.sigma_m, device.noise.dropout) == (0.008, 0.02)
    assert device.noise.mixed_within_rad == 0.0015
    exact = device.exact(scene)
    scan = device.capture(scene, np.random.default_rng(5))
    assert len(scan.beam) / len(exact.beam) == pytest.approx(0.98, abs=0.004)
    place = np.searchsorted(exact.beam, scan.beam)
    errors = np.linalg.norm(scan.points.astype(float), axis=1) - exact.range[place]
    whole = exact.other[place] == exact.range[place]
    assert np.std(errors[whole]) == pytest.approx(0.008, rel=0.03)
    # Mixed returns lie between the two sides.
    low = np.minimum(exact.range, exact.other)[place][~whole] - 0.05
    high = np.maximum(exact.range, exact.other)[place][~whole] + 0.05
    mixed = np.linalg.norm(scan.points.astype(float), axis=1)[~whole]
    assert np.all((mixed > low) & (mixed < high))


def test_mixed_returns_lie_within_half_a_beam_of_an_edge(world, view):
    device, scene, lidar_T_pattern = view
    exact = device.exact(scene)
    on_plate = exact.beam[exact.on_plate]
    divided = exact.on_plate & (exact.other != exact.range)
    points = device.model.directions[exact.beam] * exact.range[:, None]
    in_pattern = se3.apply(se3.inverse(lidar_T_pattern), points[divided])
    inside, _ = scene.board.pattern.border.signed_distance(in_pattern[:, :2])
    slant = 4.0  # half a beam on a slanted plate is longer
    assert 0 < divided.sum() < 0.3 * len(on_plate)
    assert np.all(-inside < slant * 0.0015 * exact.range[divided])


def test_print_shows_in_the_intensities(view):
    device, scene, _ = view
    scan = device.capture(scene)
    print_m = scan.intensity[scan.on_plate]
    assert print_m.min() < 15 and print_m.max() > 50
    assert scan.intensity.dtype == np.float32 and scan.intensity.max() <= 255


def test_rings_count_from_below(world):
    device = world.lidars["lidar_1"]
    ring = device.ring(np.arange(len(device.model.directions)))
    assert ring.dtype == np.uint16 and ring.max() == 15
    elevation = np.degrees(np.arcsin(device.model.directions[:, 2]))
    np.testing.assert_allclose(elevation, -15 + 2.0 * ring, atol=1e-9)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["ouster_64", "livox"])
def test_a_lidar_of_another_model_sees_the_middle_of_the_cell(name):
    cell = World(0, lidar=name)
    try:
        cell.scene.place_person(boards.AWAY)
        device = next(d for d in devices_of(cell) if d.settings.name == "lidar_1")
        assert device.sensor.model is LIDAR_MODELS[name]
        middle = se3.apply(se3.inverse(cell.scene.pose("lidar_1")), np.array([cell.rig.centre]))[0]
        cosine = device.sensor.model.directions @ (middle / np.linalg.norm(middle))
        assert np.degrees(np.arccos(cosine.max())) < 1.0
        message = device.pack(device.capture(cell.scene, None), None, Packing())
        layered = device.sensor.model.has_layers
        assert ("ring" in [field.name for field in message.fields]) is layered
    finally:
        cell.scene.close()


def test_an_unknown_model_is_refused_with_those_there_are():
    with pytest.raises(SimulatorError, match="LiDAR model 'sonar' is unknown; use vlp_16, "):
        World(0, lidar="sonar")
