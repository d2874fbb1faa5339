"""What a live view shows of a calibration agrees with the calibration."""

import collections
import math
from unittest import mock

import numpy as np
import pytest

from atom_calibration.messages.poses import edge_of, pose_matrix, transform_matrix
from atom_calibration.nodes.calibrating.calibration_view import CalibrationView
from atom_calibration.show import calibrated_tf, calibration_markers, view_options
from atom_calibration.show.annotation import POINT
from atom_calibration.show.calibration_state import (
    RUNNING,
    Status,
    sigma_messages,
    state_message,
)
from atom_calibration.show.estimate import Estimate
from atom_calibration.show.overlays import Overlays, mosaic, visible_lines
from atom_calibration.show.view_options import ViewOptions
from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.colours import packed, sensor_colours
from atom_core.model.dataset import board_edge, pose
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.solvers.base import SolverOptions
from atom_core.synthetic import scenes

CAMERA = Camera(640, 480, np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]]), np.zeros(5))


class Run:
    """A calibration of a disturbed rig, and where it stood on the way."""

    def __init__(self):
        self.scene = scenes.random_scene(3, lidar3d=1, collections=5, disturbance=(0.1, 0.1))
        self.dataset = self.scene.dataset
        self.standings = []

        def note(iteration):
            self.standings.append(Estimate.of_iteration(self.dataset, iteration))

        self.calibration = calibrate(
            self.dataset, CalibrationOptions(solver=SolverOptions(progress=note))
        )
        self.first, self.last = self.standings[0], Estimate.of_calibration(self.calibration)
        self.keys = list(self.dataset.collections)
        self.by_sensor = sensor_colours(self.dataset.sensors)
        self.by_collection = calibration_markers.collection_colours(self.keys)
        (self.pattern,) = self.dataset.patterns.values()


@pytest.fixture(scope="module")
def run():
    return Run()


def positions(markers, namespace, kind=None):
    return [
        pose_matrix(m.pose)[:3, 3]
        for m in markers
        if m.ns == namespace and (kind is None or m.type == kind)
    ]


def test_the_last_iteration_is_the_answer(run):
    assert run.calibration.status == "converged"
    last_told = run.standings[-1]
    for key, world_T_sensor in run.last.sensor_poses.items():
        np.testing.assert_allclose(last_told.sensor_poses[key], world_T_sensor, atol=1e-4)
    collection = run.calibration.dataset.collections[run.keys[0]]
    for sensor in run.dataset.sensors.values():
        expected = pose(collection, run.dataset.graph, run.dataset.world, sensor.frame)
        np.testing.assert_array_equal(run.last.sensor_poses[(sensor.name, run.keys[0])], expected)


def test_a_standing_keeps_its_numbers_while_the_solver_goes_on(run):
    assert not np.allclose(run.standings[0].x, run.standings[-1].x)
    assert run.standings[0].cost > run.standings[-1].cost


def test_sensors_go_from_their_ghosts_to_the_answer(run):
    ghosts = calibration_markers.ghost(run.first, run.keys)
    begin = calibration_markers.sensors(run.first, run.first, run.keys, run.by_sensor)
    end = calibration_markers.sensors(run.last, run.first, run.keys, run.by_sensor)
    for name in run.dataset.sensors:
        (ghost,) = positions(ghosts, name)
        np.testing.assert_allclose(positions(begin, name)[0], ghost, atol=1e-12)
        expected = run.last.sensor_poses[(name, run.keys[0])][:3, 3]
        np.testing.assert_allclose(positions(end, name)[0], expected, atol=1e-12)
        held = name == run.dataset.config.anchored_sensor
        assert bool(np.linalg.norm(expected - ghost) < 1e-9) is held
    assert all(0 < marker.color.a < 0.6 for marker in ghosts)


def test_the_ghost_of_the_input_is_not_disturbed():
    """What -ipg shows: sensors where the dataset has them, whatever -nig does."""
    dataset, told = scenes.two_cameras(1, collections=4).dataset, []
    progress = SolverOptions(progress=lambda i: told.append(Estimate.of_iteration(dataset, i)))
    calibrate(dataset, CalibrationOptions(solver=progress, noisy_initial_guess=(0.05, 0.05)))
    keys, moved = list(dataset.collections), []
    given = calibration_markers.ghost(told[0].with_transforms_of(dataset), keys)
    for name, sensor in dataset.sensors.items():
        world_T_sensor = pose(
            dataset.collections[keys[0]], dataset.graph, dataset.world, sensor.frame
        )
        (ghost,) = positions(given, name)
        np.testing.assert_allclose(ghost, world_T_sensor[:3, 3], atol=1e-12)
        (start,) = positions(calibration_markers.ghost(told[0], keys), name)
        moved.append(np.linalg.norm(start - ghost) > 0.01)
    assert any(moved)


def test_a_sensor_that_does_not_move_is_drawn_once(run):
    drawn = calibration_markers.ghost(run.first, run.keys)
    assert len(drawn) == len(run.dataset.sensors)


def test_boards_have_the_colours_and_names_of_their_collections(run):
    drawn = calibration_markers.boards(run.last, run.keys, run.by_collection)
    assert {marker.ns for marker in drawn} == {f"c{key}" for key in run.keys}
    colours = {tuple(np.round(run.by_collection[key], 3)) for key in run.keys}
    assert len(colours) == len(run.keys)
    for key in run.keys:
        plate, squares = (m for m in drawn if m.ns == f"c{key}" and m.type != m.TEXT_VIEW_FACING)
        expected = run.scene.truth.boards[run.pattern.board_key(key)]
        found = pose_matrix(squares.pose)
        assert np.linalg.norm(found[:3, 3] - expected[:3, 3]) < 0.01
        assert (plate.color.r, plate.color.g, plate.color.b) == run.by_collection[key]
    only = calibration_markers.boards(run.last, run.keys[:1], run.by_collection)
    assert {marker.ns for marker in only} == {f"c{run.keys[0]}"}


def test_what_is_not_drawn_any_more_is_deleted(run):
    before = calibration_markers.boards(run.last, run.keys, run.by_collection)
    now = calibration_markers.boards(run.last, run.keys[:1], run.by_collection)
    sent = calibration_markers.replaced(before, now)
    deleted = {(m.ns, m.id) for m in sent if m.action == m.DELETE}
    assert deleted == {(m.ns, m.id) for m in before} - {(m.ns, m.id) for m in now}
    assert [m for m in sent if m.action != m.DELETE] == now


def test_labeled_points_come_to_lie_on_the_boards(run):
    def heights(estimate):
        tables = calibration_markers.labeled_points(estimate, [run.keys[0]], run.by_sensor)
        world_T_pattern = run.last.board_poses[(run.pattern.name, run.keys[0])]
        far = []
        for table in tables.values():
            xyz = np.column_stack([table[axis] for axis in "xyz"]).astype(float)
            far.append(np.abs(se3.apply(se3.inverse(world_T_pattern), xyz)[:, 2]))
        return np.concatenate(far)

    assert np.sqrt(np.mean(heights(run.last) ** 2)) < 0.02
    assert np.sqrt(np.mean(heights(run.first) ** 2)) > 0.03


def test_points_are_coloured_by_sensor_or_by_collection(run):
    plain = calibration_markers.labeled_points(run.last, run.keys, run.by_sensor)
    assert set(plain) == {s.name for s in run.dataset.sensors.values() if s.kind.measures_range}
    for table in plain.values():
        assert len(np.unique(table["rgb"])) == 2  # inside, and lighter on the border
    coloured = calibration_markers.labeled_points(
        run.last, run.keys, run.by_sensor, run.by_collection
    )
    assert len(np.unique(coloured["lidar_1"]["rgb"])) > 2
    assert calibration_markers.cloud("world", coloured["lidar_1"]).width == len(coloured["lidar_1"])
    assert coloured["lidar_1"].dtype == POINT


def test_transforms_under_their_own_names_are_those_of_the_result(run):
    sent = calibrated_tf.transforms(run.last, view_options.OWN)
    found = {edge_of(m): transform_matrix(m) for m in sent}
    assert len(found) == len(sent)
    document = calibration_document(calibration_results(run.calibration, "ceres"), {})
    for edge in document["edges"].values():
        matrix = found[(edge["parent"], edge["child"])]
        np.testing.assert_allclose(matrix[:3, 3], edge["translation_m"], atol=1e-12)
        quaternion = se3.quaternion_from_rotation(matrix[:3, :3])
        np.testing.assert_allclose(quaternion, edge["quaternion_xyzw"], atol=1e-9)
    assert board_edge(run.pattern) in found


def test_prefixed_transforms_have_a_tree_for_each_collection(run):
    sent = calibrated_tf.transforms(run.last, view_options.PREFIXED)
    own = calibrated_tf.transforms(run.last, view_options.OWN)
    assert len(sent) == len(run.keys) * (len(own) + 1)
    assert len({m.child_frame_id for m in sent}) == len(sent)
    roots = {m.child_frame_id for m in sent if m.header.frame_id == run.dataset.world}
    assert roots == {f"c{key}_{run.dataset.world}" for key in run.keys}


def test_beside_a_running_system_only_what_is_calibrated_is_published(run):
    sent = calibrated_tf.transforms(run.last, view_options.CALIBRATED)
    document = calibration_document(calibration_results(run.calibration, "ceres"), {})
    edges = {(edge["parent"], edge["child"]) for edge in document["edges"].values()}
    assert {edge_of(m) for m in sent} == edges
    assert calibrated_tf.transforms(run.last, view_options.OFF) == []


def test_calibrated_transforms_take_the_place_of_the_descriptions(run):
    before = calibrated_tf.transforms(run.first, view_options.OWN)
    calibrated = calibrated_tf.transforms(run.last, view_options.CALIBRATED)
    merged = {edge_of(m): m for m in calibrated_tf.merged(before, calibrated)}
    assert set(merged) == {edge_of(m) for m in before}
    for message in calibrated:
        assert merged[edge_of(message)] is message


def test_the_state_has_a_row_for_each_sensor_and_kind(run):
    message = state_message(run.last, run.first, Status("converged", "well"))
    document = calibration_document(calibration_results(run.calibration, "ceres"), {})
    assert (message.running, message.status, message.message) == (False, "converged", "well")
    assert message.iteration == document["solver"]["iterations"]
    rows = {(row.sensor, row.kind): row for row in message.residuals}
    for name, sensor in document["sensors"].items():
        for kind, statistics in sensor["residuals"].items():
            row = rows.pop((name, kind))
            assert (row.rms, row.count) == (statistics["rms"], statistics["count"])
            assert row.unit == statistics["unit"]
            if name != run.dataset.config.anchored_sensor:  # which began well
                assert row.rms < row.rms_initial
    assert not rows
    assert [row.sensor for row in message.residuals] == sorted(
        (row.sensor for row in message.residuals), key=list(run.dataset.sensors).index
    )
    began = state_message(run.first, run.first, Status(RUNNING))
    assert began.running and began.iteration == 0
    assert all(row.rms == row.rms_initial for row in began.residuals)


def test_the_residuals_are_those_of_the_collection_that_is_shown(run):
    key = run.keys[1]
    message = state_message(run.last, run.first, Status("converged"), key)
    assert message.collection == key
    for row in message.residuals:
        value = run.last.table[(row.sensor, row.kind, key)]
        assert (row.rms, row.count) == (value.rms, value.count)
        assert row.rms_initial == run.first.table[(row.sensor, row.kind, key)].rms


def test_grades_are_of_the_answer_and_say_what_a_figure_is_worth(run):
    assert {r.grade for r in state_message(run.last, run.first, Status(RUNNING)).residuals} == {""}
    ended = state_message(run.last, run.first, Status("converged"))
    assert {row.grade for row in ended.residuals} == {"good"}
    began = state_message(run.first, run.first, Status("not_converged"))
    assert "wrong" in {row.grade for row in began.residuals}, "0.1 m and 0.1 rad off"


def test_there_is_a_bar_for_each_detection_and_one_for_what_is_left_out(run):
    left = (next(iter(run.dataset.sensors)), run.keys[0])
    message = state_message(run.last, run.first, Status("converged"), "", run.by_sensor, {left})
    bars = {(bar.sensor, bar.collection): bar for bar in message.bars}
    assert len(bars) == len(message.bars)
    assert set(bars) == {(d.sensor, d.collection) for d in run.last.problem.detections} | {left}
    assert [place for place, bar in bars.items() if bar.left_out] == [left]
    assert message.residuals[0].colour == packed(run.by_sensor[message.residuals[0].sensor])


def test_sigmas_are_those_that_are_written(run):
    document = calibration_document(calibration_results(run.calibration, "ceres"), {})
    edges = {name: edge for edge in document["edges"].values() for name in edge["sensors"]}
    for sigma in sigma_messages(run.calibration):
        edge = edges[sigma.sensor]
        assert sigma.held == edge["anchored"]
        assert sigma.translation_m == pytest.approx(max(edge["combined_sigma_translation_m"]))
        assert sigma.rotation_rad == pytest.approx(max(edge["combined_sigma_rotation_rad"]))


def test_residuals_that_were_not_there_at_the_start_are_unknown(run):
    empty = Estimate(0, 1.0, run.dataset, run.first.problem, run.first.x)
    empty.__dict__["table"] = {}
    message = state_message(run.last, empty, Status(RUNNING))
    assert all(math.isnan(row.rms_initial) for row in message.residuals)


def test_pictures_show_where_corners_and_borders_are_projected(run):
    overlays = Overlays(run.first, run.by_collection)
    shown = run.keys[0]
    pictures = overlays.pictures(run.last, shown)
    cameras = [s for s in run.dataset.sensors.values() if s.camera is not None]
    assert set(pictures) == {s.name for s in cameras}
    bgr = np.array(run.by_collection[shown][::-1]) * 255
    for corners in run.last.corners():
        if corners.key.collection != shown:
            continue
        assert np.sqrt(np.mean((corners.detected - corners.projected) ** 2)) < 1.0
        picture = pictures[corners.key.sensor]
        for x, y in np.round(corners.projected).astype(int):
            here = picture[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3).astype(float)
            assert np.min(np.linalg.norm(here - bgr, axis=1)) < 60, "a cross of the colour"
    whole = overlays.pictures(run.last)
    for name in pictures:
        assert whole[name].shape == pictures[name].shape
        assert not np.array_equal(whole[name], pictures[name])
        assert not np.array_equal(whole[name], overlays.pictures(run.first)[name])


def test_a_border_that_runs_behind_the_camera_is_cut_there():
    square = np.array([[-1.0, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]])
    (closed,) = visible_lines(CAMERA, square)
    np.testing.assert_array_equal(closed[0], closed[-1])
    np.testing.assert_allclose(closed[:4, 0] / 16.0, CAMERA.project(square), atol=0.05)
    square[0, 2] = -1.0
    (cut,) = visible_lines(CAMERA, square)
    np.testing.assert_allclose(cut[:, 0] / 16.0, CAMERA.project(square[1:]), atol=0.05)
    assert visible_lines(CAMERA, square * [1, 1, -1] - [0, 0, 3]) == []


def test_a_mosaic_holds_every_picture_with_its_name():
    grey = {str(v): np.full((100, 200, 3), v, np.uint8) for v in (10, 20, 30, 40, 50)}
    few = mosaic({name: grey[name] for name in ("10", "20", "30")})
    assert few.shape == (960, 640, 3), "up to four in a column"
    assert [int(few[310 + 320 * row, 630, 0]) for row in range(3)] == [10, 20, 30]
    assert (few[:60, :120] == 255).any(), "the name is written large"
    whole = mosaic(grey)
    assert whole.shape == (960, 1280, 3)
    assert [int(whole[310, 630, 0]), int(whole[310, 1270, 0])] == [10, 20]
    assert mosaic({}).any() == np.False_


def test_clouds_are_drawn_into_the_images_where_the_poses_put_them(run):
    overlays, key = Overlays(run.first, run.by_collection), run.keys[0]
    lidar = {"lidar_1": (0.1, 0.2, 1.0)}
    camera = next(s for s in run.dataset.sensors.values() if s.camera is not None)
    plain = overlays.pictures(run.last, None)[camera.name]
    drawn = overlays.pictures(run.last, None, lidar)[camera.name]
    blue = np.all(drawn == (255, 51, 26), axis=2)
    assert blue.any() and not np.all(plain == (255, 51, 26), axis=2).any()
    rows, columns = np.nonzero(blue)
    borders = []
    for (_, at), world_T_pattern in run.last.board_poses.items():
        world_T_camera = run.last.sensor_poses[(camera.name, at)]
        camera_T_pattern = se3.inverse(world_T_camera) @ world_T_pattern
        borders.append(
            visible_lines(camera.camera, se3.apply(camera_T_pattern, _corners(run.pattern)))
        )
    hull = np.vstack([line.reshape(-1, 2) / 16.0 for lines in borders for line in lines])
    assert columns.min() > hull[:, 0].min() - 6 and columns.max() < hull[:, 0].max() + 6
    assert rows.min() > hull[:, 1].min() - 6 and rows.max() < hull[:, 1].max() + 6
    assert overlays.pictures(run.last, key, lidar)[camera.name].shape == drawn.shape


def _corners(pattern):
    flat = pattern.border.sample(0.05)
    return np.column_stack([flat, np.zeros(len(flat))])


class Broken(CalibrationView):
    """A view that cannot draw; its topics lead nowhere."""

    def _open(self, dataset):
        self._publishers = collections.defaultdict(mock.Mock)

    def _publish(self, estimate, status, shown):
        raise ValueError("nothing can be drawn")


def test_a_view_that_fails_does_not_stop_the_calibration(run, caplog):
    view = Broken(ViewOptions())
    view.begin(run.dataset)
    options = CalibrationOptions(solver=SolverOptions(progress=view.progress))
    result = calibrate(run.dataset, options)
    view.end(result, options)
    assert result.status == "converged"
    told = [record.getMessage() for record in caplog.records if "the view has failed" in record.msg]
    assert len(told) == 1 and "nothing can be drawn" in told[0]
