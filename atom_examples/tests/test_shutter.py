"""Pictures of a board in motion are smeared and sheared; those of one at rest are as they were."""

import cell_boards as boards
import numpy as np
import pytest
import rosbag

from atom_core.geometry import se3
from atom_core.labeling.rgb import RgbLabeler
from atom_core.labeling.view_quality import clear_squares, corner_view
from atom_core.synthetic.board import charuco
from atom_examples.cell_simulator import main as program
from atom_examples.cell_simulator.recorder import START_S, Recording, record
from atom_examples.cell_simulator.shutter import Shutter
from atom_examples.cell_simulator.trajectory import TICK_S, Trajectory

ROWS = 48


def of_time(after_s):
    """A picture whose value is the time [ms]."""
    return np.full((ROWS, 4, 3), 1000.0 * after_s, np.float32)


def test_without_a_shutter_a_picture_is_of_one_instant():
    ((after_s, share),) = Shutter().instants(ROWS)
    assert after_s == 0.0 and np.all(share == 1.0)


@pytest.mark.parametrize("readout_s", [0.0, 0.02])
@pytest.mark.parametrize("exposure_s", [0.0, 0.007, 0.02])
def test_rows_see_the_middle_of_their_own_exposure(exposure_s, readout_s):
    picture = Shutter(exposure_s, readout_s).picture(of_time, ROWS)
    middle_ms = 1000.0 * readout_s * ((np.arange(ROWS) + 0.5) / ROWS - 0.5)
    np.testing.assert_allclose(picture[:, 0, 0], middle_ms, atol=1.3)  # half a step
    assert abs(picture.mean()) < 0.1


def test_what_is_lit_for_a_part_of_the_exposure_has_that_part_of_the_light():
    def flash(after_s):
        return np.full((ROWS, 4, 3), 100.0 * (after_s > 0.005), np.float32)

    picture = Shutter(exposure_s=0.02).picture(flash, ROWS)
    np.testing.assert_allclose(picture, 25.0, atol=0.1)


def test_the_board_moves_steadily_between_ticks(world, plans):
    pattern = world.scene.board.pattern
    trajectory = Trajectory(plans(world, "train", 2), 0.3, pattern)
    middle = np.append(pattern.border.centre, 0.0)[None]
    ticks = np.arange(0.0, trajectory.ticks - 1, 0.05)
    way = [se3.apply(trajectory.state(tick).world_T_pattern, middle)[0] for tick in ticks]
    steps_m = np.linalg.norm(np.diff(way, axis=0), axis=1)
    assert steps_m.max() < 0.55 * 0.05 * TICK_S  # half a metre a second, and rounding
    for tick in range(trajectory.ticks):
        assert trajectory.state(float(tick)).stop == trajectory.state(tick).stop


@pytest.mark.parametrize(
    "words", [["--exposure", "-1"], ["--readout", "nan"], ["--exposure", "1e3"]]
)
def test_shutters_that_are_none_are_refused(tmp_path, words, capsys):
    assert program.main(["--bag", str(tmp_path / "a.bag"), *words]) == 2
    assert "give 0 to 100 ms" in capsys.readouterr().err


def test_a_board_that_moves_is_smeared_as_far_as_it_moves_and_labeled_at_the_middle(world):
    scene, pattern, camera = world.scene, world.scene.board.pattern, world.colours["rgb_1"]
    scene.place_person(boards.AWAY)
    world_T_camera = scene.pose("rgb_1_optical_frame")
    pose = boards.before(1.4, 0.0, 0.0, (0.0, 0.0), pattern)

    def drawn(after_s):
        moved = pose.copy()
        moved[0, 3] += 0.4 * after_s  # [m / s]
        scene.place_board(world_T_camera @ moved)
        return camera.drawn(scene)

    shutter = Shutter(exposure_s=0.02)
    picture = camera.developed(shutter.picture(drawn, camera.camera.height))
    sensor = world.rig.sensors["rgb_1"]
    found = RgbLabeler(sensor, pattern, charuco()).label(picture)
    assert found.detected
    corners = camera.camera.project(se3.apply(pose, pattern.corners_of(found.label.ids)))
    error_px = found.label.pixels - corners
    assert np.linalg.norm(error_px.mean(axis=0)) < 0.1 and np.abs(error_px).max() < 0.6
    figures = corner_view(picture, pattern, found.label, clear_squares(charuco()), pose)
    moved_px = camera.camera.focal_px[0] * 0.4 * 0.02 / 1.4
    assert 0.8 * moved_px <= figures["smear_px"] <= 1.6 * moved_px


@pytest.mark.long
def test_only_pictures_of_motion_differ_and_no_label_is_wrong(
    world, plans, remembered_plans, tmp_path
):
    still = Recording(collections=2, stop_s=0.3, moving_image_hz=2.0)
    slow = Recording(
        collections=2, stop_s=0.3, moving_image_hz=2.0, exposure_s=0.03, readout_s=0.02
    )
    assert "exposure_s" not in still.document() and slow.document()["readout_s"] == 0.02
    messages = {}
    for name, recording in (("still", still), ("slow", slow)):
        path = tmp_path / f"{name}.bag"
        record(world, recording, path, progress=False)
        with rosbag.Bag(str(path)) as bag:
            messages[name] = [(t, m, at.to_sec()) for t, m, at in bag.read_messages()]
    trajectory = Trajectory(plans(world, "train", 2), 0.3, world.scene.board.pattern)
    differ, errors_px = 0, []
    for (topic, one, at), (_, other, _) in zip(messages["still"], messages["slow"]):
        state = trajectory.state(int(round((at - START_S) / TICK_S)))
        if one == other:
            assert not (topic.endswith("image_raw") and "rgb" in topic and state.stop is None)
            continue
        assert "rgb" in topic and state.stop is None
        differ += 1
        if topic.split("/")[1] in world.rig.sensors:  # not the colours of the depth camera
            errors_px.append(largest_error_px(world, topic.split("/")[1], other, state))
    assert differ >= 3
    assert np.nanmax(errors_px) < 9.0  # as far as the board moves while rows are read


def largest_error_px(world, name, message, state):
    """Return how far a corner is at most from where it was at the stamp; NaN: no label."""
    image = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
    pattern, sensor = world.scene.board.pattern, world.rig.sensors[name]
    found = RgbLabeler(sensor, pattern, charuco()).label(image)
    if not found.detected:
        return np.nan
    camera_T_pattern = se3.inverse(world.scene.pose(sensor.frame)) @ state.world_T_pattern
    corners = se3.apply(camera_T_pattern, pattern.corners_of(found.label.ids))
    return np.abs(found.label.pixels - sensor.camera.project(corners)).max()
