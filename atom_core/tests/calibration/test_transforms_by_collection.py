"""A transform with a value in each collection is judged in each of them."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.weak_directions import edge_covariance
from atom_core.calibration.options import AUTO, OFF, CalibrationOptions
from atom_core.evaluation.edge_spread import edge_spread, spread_collection, usual_sigma
from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import MULTIPLE, board_edge
from atom_core.model.transforms import Edge
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.verdict import GOOD, WEAK
from atom_core.synthetic import scenes
from atom_core.synthetic.driving import vehicle_before_a_board
from atom_core.synthetic.mistakes import with_scaled_focal_length

BASE, GPS = Edge("world", "rig_base"), Edge("world", "gps")
QUIET = CalibrationOptions(model_errors=OFF)
HELD_BOARDS = replace(QUIET, anchor_patterns=True)


def with_odometry(dataset, edge=BASE, off=(0.02, 0.02)):
    """Return the dataset with a transform to estimate that is off in each collection anew."""
    rng = np.random.default_rng(5)
    fixed = dataset.first_value(edge)
    values = {
        key: {edge: se3.moved(fixed, se3.random_move(*off, rng))} for key in dataset.collections
    }
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    return replace(
        dataset.with_transforms(values),
        config=replace(dataset.config, additional_tfs={"odom": entry}),
        edge_types={**dataset.edge_types, edge: MULTIPLE},
    )


def with_true_boards(scene):
    """Return a scene's dataset with its boards where they are."""
    boards = scene.truth.boards
    return scene.dataset.with_transforms(
        {
            key: {board_edge(p): boards[p.board_key(key)] for p in scene.dataset.patterns.values()}
            for key in scene.dataset.collections
        }
    )


def with_labels(dataset, key, keep):
    """Return the dataset with those labels of a collection that ``keep`` returns something for."""
    collection = dataset.collections[key]
    labels = {at: keep(at[0], label) for at, label in collection.labels.items()}
    labels = {at: label for at, label in labels.items() if label is not None}
    return replace(
        dataset, collections={**dataset.collections, key: replace(collection, labels=labels)}
    )


def only_the_inside(sensor, label):
    """Return a LiDAR's label without the border; None of others."""
    return replace(label, limit_indices=np.zeros(0, int)) if sensor == "lidar_1" else None


@pytest.fixture(scope="module")
def rig():
    return scenes.random_scene(0, rgb=2, depth=0, lidar3d=1, collections=12)


@pytest.fixture(scope="module")
def open_in_one(rig):
    """Boards are held, and in 003 a LiDAR alone saw the board, without its border."""
    dataset = with_labels(with_odometry(with_true_boards(rig)), "003", only_the_inside)
    return calibrate(dataset, HELD_BOARDS)


def test_odometry_that_carries_all_who_see_boards_in_hand_is_open_in_all_collections(rig):
    result = calibrate(with_odometry(rig.dataset), QUIET)
    assert result.status == "rank_deficient"
    (weak,) = result.weak_directions
    assert {name.split()[0] for name in weak.parameters} == {"odom"}
    count = len({key.collection for key in result.problem.detections})
    assert f"in all {count} collections" in weak.why
    assert "`fixed: true`" in weak.why
    verdict = calibration_verdict(calibration_results(result, "any"))
    assert verdict.grade == WEAK and weak.why in verdict.sentence
    assert {sensor.grade for sensor in verdict.sensors.values()} == {GOOD}


def test_odometry_that_is_open_in_one_collection_is_so_in_that_by_name(open_in_one):
    assert open_in_one.status == "rank_deficient"
    (weak,) = open_in_one.weak_directions
    assert " in collection 003: only lidar_1 tells of it there" in weak.why
    assert weak.sigma > 0.05


def test_odometry_with_boards_that_stand_is_known_in_all_collections(rig):
    result = calibrate(with_odometry(with_true_boards(rig)), HELD_BOARDS)
    assert result.status == "converged" and result.weak_directions == ()
    for key, collection in result.dataset.collections.items():
        off = collection.transforms[BASE][:3, 3] - rig.dataset.first_value(BASE)[:3, 3]
        assert np.linalg.norm(off) < 0.01, key
    verdict = calibration_verdict(calibration_results(result, "any"))
    assert verdict.grade == GOOD, verdict.sentence
    of_noise = replace(result, covariance=result.covariance.of_model)
    assert np.max(np.abs(usual_sigma(of_noise, BASE)[3:])) < 0.003
    assert np.max(np.abs(usual_sigma(result, BASE)[3:])) < 0.006  # with usual errors of sensors


def in_sigmas(result, true, which):
    """Return (c, 6) how far the transform is off in each collection, in standard deviations."""
    found = []
    for i, block in result.problem.parameters.pose_blocks():
        if block.edge == BASE and block.collection is not None:
            pose = result.dataset.collections[block.collection].transforms[BASE]
            turn = se3.rotation_vector_from_rotation(pose[:3, :3] @ true[:3, :3].T)
            spread = edge_covariance(
                block, result.summary.x[result.problem.parameters.slice_of(i)], which.block(i)
            )
            error = np.concatenate([turn, pose[:3, 3] - true[:3, 3]])
            found.append(error / np.sqrt(np.diagonal(spread)))
    return np.abs(found)


def test_usual_errors_of_sensors_are_in_what_is_known_of_it_in_each_collection(rig):
    """With focal lengths 0.3 % long, it ended good and up to 17 of its combined sigmas off."""
    dataset, true = with_odometry(with_true_boards(rig)), rig.dataset.first_value(BASE)
    for name in ("rgb_1", "rgb_2"):
        dataset = with_scaled_focal_length(dataset, name, 1.003)
    result = calibrate(dataset, CalibrationOptions(anchor_patterns=True))
    assert result.status == "converged"
    assert np.max(in_sigmas(result, true, result.covariance)) > 8.0
    assert np.max(in_sigmas(result, true, result.covariance.combined)) < 2.5


def test_it_is_known_where_all_usual_errors_are_estimated_too():
    """With `--model_errors auto` none is left that it follows: a traceback."""
    scene = vehicle_before_a_board(0, odometry=True, off=0.01)
    result = calibrate(scene.dataset, CalibrationOptions(model_errors=AUTO))
    assert result.status == "converged" and calibration_results(result, "any").edges
    stated, combined = result.covariance, result.covariance.combined
    blocks = [i for i, b in result.problem.parameters.pose_blocks() if b.collection is not None]
    for i in blocks:
        np.testing.assert_allclose(combined.block(i), stated.block(i))


def test_what_it_follows_is_what_the_shared_edges_follow(rig):
    result = calibrate(with_odometry(with_true_boards(rig)), HELD_BOARDS)
    combined, stated = result.covariance.combined, result.covariance
    blocks = [i for i, b in result.problem.parameters.pose_blocks() if b.edge == BASE]
    (edge,) = (s.edge for s in result.dataset.sensors.values() if s.name == "lidar_1")
    (lidar,) = (i for i, b in result.problem.parameters.pose_blocks() if b.edge == edge)
    for i in blocks:
        for one in (combined, stated):
            rows, columns = np.array([i, i, lidar, lidar]), np.array([i, lidar, i, lidar])
            both = np.block([list(one.pairs(rows, columns))[k : k + 2] for k in (0, 2)])
            np.testing.assert_allclose(both, both.T, atol=1e-12)
            assert np.linalg.eigvalsh(both)[0] > -1e-12  # a covariance of both together
        more = combined.block(i) - stated.block(i)
        assert np.linalg.eigvalsh(more)[0] > -1e-12 and np.trace(more) > 0.0


def test_its_sigmas_are_those_of_the_collection_in_which_it_is_known_worst(open_in_one):
    assert spread_collection(open_in_one, BASE) == "003"
    assert np.max(np.diagonal(edge_spread(open_in_one, BASE))) > 1.0
    document = calibration_document(calibration_results(open_in_one, "any"), {})
    edges = document["edges"]
    assert edges[str(BASE)]["sigma_collection"] == "003"
    assert max(edges[str(BASE)]["sigma_translation_m"]) > 1.0
    lidar = open_in_one.dataset.sensors["lidar_1"].edge
    assert edges[str(lidar)]["sigma_collection"] is None


def test_a_collection_in_which_nothing_hangs_on_it_leaves_nothing_open(rig):
    """The first camera stands in the world; in 003 it alone sees the board."""
    dataset = with_odometry(with_true_boards(rig))
    camera = dataset.sensors["rgb_1"]
    post = Edge("world", camera.edge.parent)
    first = next(iter(dataset.collections.values()))
    fixed = dataset.first_value(BASE) @ first.transforms[Edge("rig_base", camera.edge.parent)]
    moved = {
        key: replace(
            c,
            transforms={
                **{e: t for e, t in c.transforms.items() if e.child != camera.edge.parent},
                post: fixed,
            },
        )
        for key, c in dataset.collections.items()
    }
    dataset = replace(dataset, collections=moved)
    alone = with_labels(dataset, "003", lambda sensor, label: label if sensor == "rgb_1" else None)
    result = calibrate(alone, HELD_BOARDS)
    assert not any("odom" in name for w in result.weak_directions for name in w.parameters)
    assert spread_collection(result, BASE) != "003"


def test_a_prior_holds_what_is_open_in_each_collection_and_is_named(rig):
    options = replace(QUIET, priors={"odom": (0.03, 0.03)})
    result = calibrate(with_odometry(rig.dataset), options)
    assert result.weak_directions == () and result.status == "converged", result.message
    (held,) = [h for h in result.held_directions if "odom" in h.parameters[0]]
    assert held.priors == ("odom",) and held.sigma < 0.05
    verdict = calibration_verdict(calibration_results(result, "any"))
    assert verdict.grade == WEAK and "'odom' (world-rig_base) is known to 30 mm" in verdict.sentence
    assert "in most collections" in verdict.sentence and "prior" in verdict.sentence


@pytest.mark.parametrize("multiple", [False, True])
def test_a_transform_on_which_nothing_seen_hangs_is_called_that(rig, multiple):
    dataset = rig.dataset.with_transforms(
        {key: {GPS: np.eye(4)} for key in rig.dataset.collections}
    )
    dataset = with_odometry(dataset, GPS)
    if not multiple:
        pose = dataset.first_value(GPS)
        dataset = dataset.with_transforms({key: {GPS: pose} for key in dataset.collections})
        dataset = replace(dataset, edge_types={**dataset.edge_types, GPS: "fixed"})
    result = calibrate(dataset, QUIET)
    assert result.status == "rank_deficient"
    expected = "no sensor and no board that was seen hangs on 'odom' (world-gps)"
    assert all(expected in weak.why for weak in result.weak_directions)
