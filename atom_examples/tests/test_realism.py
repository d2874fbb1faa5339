"""The rough profile of the simulated cell: each error has its size, and the truth tells it."""

import json
from dataclasses import fields, replace

import cell_boards as boards
import numpy as np
import pytest
import rosbag
import yaml

from atom_core.geometry import se3
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic import PLAIN, ROUGH, Planted
from atom_core.synthetic.board import board_hits, is_dark
from atom_examples import demo
from atom_examples.cell_simulator import main as program
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.recorder import Recording, record
from atom_examples.cell_simulator.settings import read_settings
from atom_examples.cell_simulator.world import World, cell_files

LIDARS = ("lidar_1", "lidar_2", "lidar_3")
EYE, MIDDLE = np.array([0.3, 1.3, 2.0]), np.array([0.0, -0.6, 1.1])


@pytest.fixture(scope="module")
def rough():
    """The cell of seed 0 with the errors of the rough profile."""
    cell = World(0, profile="rough")
    yield cell
    cell.scene.close()


@pytest.fixture
def both(world, rough):
    """Both cells with the board in the same place, nobody beside it."""
    away = (MIDDLE - EYE) / np.linalg.norm(MIDDLE - EYE)
    x = np.cross(away, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(away, x), away])
    middle = np.append(world.scene.board.pattern.border.centre, 0.0)
    for cell in (world, rough):
        cell.scene.place_person(boards.AWAY)
        cell.scene.place_board(se3.transform(rotation, MIDDLE - rotation @ middle))
    return world, rough


def ranges_of(scan):
    return np.linalg.norm(scan.points.astype(float), axis=1)


# ------------------------------------------------------------------------------- settings


def test_the_committed_profile_is_that_of_the_synthetic_scenes():
    profiles = read_settings(cell_files().sensors).profiles
    assert profiles["plain"] == PLAIN
    # beams are as wide in either profile
    assert profiles["rough"] == replace(ROUGH, beam_divergence_rad=0.0)


def test_a_plain_cell_has_no_errors(world):
    assert world.planted == Planted()
    assert world.stamp_error_s(1, 2) == 0.0
    moving = {("a", "b"): np.eye(4)}
    assert world.as_told(moving, 1)[("a", "b")] is moving[("a", "b")]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"lidar_ofset_m": 0.1}, r"realism: rough: 'lidar_ofset_m' is unknown"),
        ({"lidar_offset_m": "long"}, r"rough: 'lidar_offset_m' is malformed"),
        ({"dark_lost": 2.0}, r"rough: .*dark_lost.* less than 1"),
        ({"blur_px": -1.0}, r"rough: blur_px must not be negative"),
        (3, r"rough: a mapping"),
    ],
)
def test_a_malformed_profile_is_refused_by_name(tmp_path, values, message):
    document = yaml.safe_load(cell_files().sensors.read_text(encoding="utf-8"))
    document["realism"]["rough"] = values
    path = tmp_path / "sensors.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(SimulatorError, match=message):
        read_settings(path)


def test_a_profile_that_is_not_in_the_file_is_refused(tmp_path):
    document = yaml.safe_load(cell_files().sensors.read_text(encoding="utf-8"))
    del document["realism"]
    path = tmp_path / "sensors.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(SimulatorError, match="no profile 'rough'; use plain"):
        World(0, replace_sensors(path), profile="rough")


def replace_sensors(path):
    return cell_files().__class__(
        **{
            field.name: path if field.name == "sensors" else getattr(cell_files(), field.name)
            for field in fields(cell_files())
        }
    )


# --------------------------------------------------------------------------------- ranges


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", LIDARS)
def test_returns_of_the_room_are_longer_by_offset_and_layer(both, name):
    plain, spoiled = (cell.lidars[name].capture(cell.scene) for cell in both)
    errors = both[1].planted.of(name)
    assert errors.offset_m != 0.0 and len(errors.ring_offsets_m) == 16
    _, mine, theirs = np.intersect1d(
        plain.beam[~plain.on_plate], spoiled.beam[~spoiled.on_plate], return_indices=True
    )
    assert len(mine) > 20000
    first, second = (s.points[~s.on_plate][i] for s, i in ((plain, mine), (spoiled, theirs)))
    longer = np.linalg.norm(second, axis=1) - np.linalg.norm(first, axis=1)
    rings = both[1].lidars[name].ring(spoiled.beam[~spoiled.on_plate][theirs])
    planted = errors.offset_m + np.array(errors.ring_offsets_m)[rings]
    # some beams meet another thing where the board is a millimetre larger
    assert np.mean(np.abs(longer - planted) < 2e-5) > 0.999


@pytest.mark.parametrize("name", LIDARS)
def test_the_board_is_bent_and_larger_and_its_dark_squares_read_longer(both, name):
    cell = both[1]
    lidar, pattern = cell.lidars[name], cell.scene.board.pattern
    assert pattern.sagitta_m == 0.001 and pattern.square_m == pytest.approx(0.06 * 1.0015)
    scan = lidar.capture(cell.scene)
    lidar_T_pattern = se3.inverse(cell.scene.pose(name)) @ cell.scene.world_T_pattern
    beams, ranges = scan.beam[scan.on_plate], ranges_of(scan)[scan.on_plate]
    true, in_plane = board_hits(lidar_T_pattern, pattern, lidar.model.directions[beams])
    dark = is_dark(lidar_T_pattern, pattern, in_plane)
    met = np.isfinite(true)  # all but the plate's rim of a millimetre
    assert np.sum(met) > 0.98 * len(beams) and np.any(dark) and np.any(~dark)
    planted = cell.planted.of(name).error_m(true[met], lidar.ring(beams[met])) + 0.005 * dark[met]
    np.testing.assert_allclose((ranges - true)[met], planted, atol=2e-5)


def test_a_tenth_of_the_returns_from_dark_squares_is_lost(both):
    lidar, pattern = both[1].lidars["lidar_1"], both[1].scene.board.pattern
    lidar_T_pattern = se3.inverse(both[1].scene.pose("lidar_1")) @ both[1].scene.world_T_pattern

    def dark_returns(scan):
        beams = scan.beam[scan.on_plate]
        _, in_plane = board_hits(lidar_T_pattern, pattern, lidar.model.directions[beams])
        return np.sum(is_dark(lidar_T_pattern, pattern, in_plane))

    whole = dark_returns(lidar.capture(both[1].scene))
    rngs = [np.random.default_rng(k) for k in range(20)]
    left = [dark_returns(lidar.capture(both[1].scene, rng)) / whole for rng in rngs]
    assert np.mean(left) == pytest.approx(0.9 * (1.0 - lidar.noise.dropout), abs=0.015)


def test_waves_and_holes_are_in_the_depth_image(both):
    plain, spoiled = (cell.depths["depth_1"].capture(cell.scene) for cell in both)
    share = (spoiled - plain) / (0.004 + 0.003 * plain)
    both_seen = np.isfinite(share)
    assert np.mean(~both_seen) - np.mean(np.isnan(plain)) == pytest.approx(0.04, abs=0.03)
    assert np.quantile(share[both_seen], [0.01, 0.99]) == pytest.approx([-1.0, 1.0], abs=0.02)
    jump = np.abs(np.diff(plain, axis=1)) > 0.5
    assert np.any(jump) and np.all(np.isnan(spoiled[:, :-1][jump] + spoiled[:, 1:][jump]))


# -------------------------------------------------------------------------------- pictures


def test_corners_are_where_the_true_camera_sees_the_true_board(both):
    _, cell = both
    nominal = cell.settings.sensors["rgb_3"].camera
    camera, scene = cell.colours["rgb_3"], cell.scene
    assert not np.array_equal(camera.camera.K, nominal.K)
    board = pattern_from_config("pattern_1", cell.settings.board)
    labeler = RgbLabeler(cell.rig.sensors["rgb_3"], board, cell.settings.board)
    label = labeler.label(camera.capture(scene, np.random.default_rng(0))).label
    camera_T_pattern = se3.inverse(scene.pose("rgb_3_optical_frame")) @ scene.world_T_pattern
    true = se3.apply(camera_T_pattern, scene.board.pattern.corners_of(label.ids))
    told = se3.apply(camera_T_pattern, board.corners_of(label.ids))
    assert len(label.ids) > 80
    off_px = label.pixels - camera.camera.project(true)
    assert np.sqrt(np.mean(off_px**2)) < 0.1 and np.max(np.abs(np.mean(off_px, axis=0))) < 0.03
    assert np.min(np.linalg.norm(label.pixels - nominal.project(told), axis=1)) > 1.0


def test_pictures_are_blurred_and_darker_in_the_corners(both):
    plain, spoiled = (cell.colours["rgb_3"].capture(cell.scene).astype(float) for cell in both)
    corner, middle = (slice(0, 40), slice(0, 40)), (slice(200, 240), slice(560, 720))
    dark = np.mean(spoiled[corner]) / np.mean(plain[corner])
    assert dark == pytest.approx(1.0 - 0.3, abs=0.03)
    assert np.mean(spoiled[middle]) / np.mean(plain[middle]) == pytest.approx(1.0, abs=0.03)
    steepest = [
        np.max(np.abs(np.diff(picture[:, 500:760, 0], axis=1))) for picture in (plain, spoiled)
    ]
    assert steepest[1] < 0.75 * steepest[0]


def test_each_picture_has_an_exposure_of_its_own(both):
    camera, scene = both[1].colours["rgb_3"], both[1].scene
    grey = [np.mean(camera.capture(scene, np.random.default_rng(k))) for k in range(12)]
    assert 0.04 < np.std(np.log(grey)) < 0.2
    again = camera.capture(scene, np.random.default_rng(0))
    assert np.mean(again) == grey[0]


# ------------------------------------------------------------------------------ recordings


@pytest.fixture(scope="module")
def bag(tmp_path_factory, rough):
    path = tmp_path_factory.mktemp("rough") / "rough.bag"
    record(rough, Recording(collections=1, stop_s=1.0), path, progress=False)
    return path


@pytest.mark.slow
def test_the_truth_file_has_what_was_drawn(bag, rough):
    realism = json.loads(bag.with_suffix(".truth.json").read_text())["realism"]
    assert realism["profile"] == "rough" and realism["stamp_sigma_s"] == 0.005
    assert set(realism["sensors"]) == set(rough.rig.sensors)
    for name in LIDARS:
        assert realism["sensors"][name]["offset_m"] == rough.planted.of(name).offset_m
    board = {"scale": 0.0015, "shift_m": [0.0, 0.0], "bend_m": 0.001, "thickness_m": 0.0}
    assert realism["boards"]["pattern_1"] == board
    assert realism["sensors"]["rgb_1"]["focal_scale"] == list(rough.planted.of("rgb_1").focal_scale)


@pytest.mark.slow
def test_stamps_and_moving_transforms_are_off_intrinsics_are_as_told(bag, rough):
    off_s, places, infos = [], [], {}
    with rosbag.Bag(str(bag)) as opened:
        for topic, message, time in opened.read_messages():
            if topic in {s.topic for s in rough.settings.all}:
                off_s.append((message.header.stamp - time).to_sec())
            if topic == "/tf":
                moved = message.transforms[1].transform.translation
                places.append([moved.x, moved.y, moved.z])
            if topic.endswith("camera_info"):
                infos.setdefault(topic, message)
    assert len(off_s) > 20 and np.std(off_s) == pytest.approx(0.005, rel=0.35)
    assert np.std(places, axis=0) == pytest.approx([0.0005] * 3, rel=0.5)
    for name in ("rgb_1", "rgb_2", "rgb_3"):
        assert (
            tuple(rough.settings.sensors[name].camera.K.ravel()) == infos[f"/{name}/camera_info"].K
        )


@pytest.mark.slow
def test_labels_know_the_stamps_as_told(bag):
    with rosbag.Bag(str(bag)) as opened:
        told = {m.header.stamp.to_sec() for _, m, _ in opened.read_messages(["/lidar_1/points"])}
    with np.load(bag.with_suffix(".labels.npz")) as arrays:
        stamps = arrays["000/lidar_1/stamps"]
    assert len(stamps) > 3 and all(stamp in told for stamp in stamps)


def test_the_same_seed_draws_the_same_errors_and_another_does_not(rough):
    again, other = World(0, profile="rough"), World(1, profile="rough")
    assert again.planted == rough.planted
    assert again.stamp_error_s(10, 3, 7) == rough.stamp_error_s(10, 3, 7)
    for name in LIDARS:
        assert other.planted.of(name).offset_m != rough.planted.of(name).offset_m
    for cell in (again, other):
        cell.scene.close()


def test_scanners_have_errors_too():
    cell = World(0, scanners=True, profile="rough")
    scan = cell.lidars["scanner_1"].capture(cell.scene)
    offset = cell.planted.of("scanner_1").offset_m
    exact = cell.lidars["scanner_1"].exact(cell.scene)
    room = ~exact.on_plate
    np.testing.assert_allclose(ranges_of(scan)[room] - exact.range[room], offset, atol=1e-5)
    assert offset != 0.0
    cell.scene.close()


# ---------------------------------------------------------------------------------- options


def test_the_option_of_the_simulator_and_of_the_demo():
    words = ["--bag", "a.bag", "--realism", "rough"]
    assert program.build_parser().parse_args(words).realism == "rough"
    assert program.build_parser().parse_args(words[:2]).realism == "plain"
    assert demo.build_parser().parse_args(["--output", "a", *words[2:]]).realism == "rough"
    with pytest.raises(SystemExit):
        program.build_parser().parse_args([*words[:3], "smooth"])


def test_the_demo_hands_it_on(monkeypatch, tmp_path):
    calls = []

    def stand_in(words):
        calls.append([str(word) for word in words])
        return 2

    monkeypatch.setattr(demo.cell_simulator, "main", stand_in)
    assert demo.main(["--output", str(tmp_path / "out"), "--realism", "rough"]) == 2
    assert calls[0][calls[0].index("--realism") + 1] == "rough"
