"""Methods that take two sensors at a time: right without noise, worse than the joint solution."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from atom_core.calibration.calibrate import calibrate
from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.comparison import Measured, compare_rigs
from atom_core.evaluation.baselines.icp import (
    METHODS,
    Clouds,
    icp_baselines,
    registered,
    whole_cloud,
)
from atom_core.evaluation.baselines.links import (
    Link,
    edge_value,
    linked_rig,
    motion_between,
    placed_at,
    seen_by_both,
    usual_pose,
)
from atom_core.evaluation.baselines.pairwise import pairwise_baseline
from atom_core.evaluation.baselines.stereo import stereo_baseline
from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.geometry.se3 import pose_difference
from atom_core.model.dataset import DataSource, pose
from atom_core.model.truth import with_truth
from atom_core.synthetic import Noise, Sampling, scenes

BOARD = "pattern_1"


@pytest.fixture(scope="module")
def exact():
    """Two cameras, a depth camera and two LiDARs without noise, 3 cm off in the dataset."""
    return scenes.random_scene(
        6,
        rgb=2,
        depth=1,
        lidar3d=2,
        collections=10,
        noise=Noise.none(),
        sampling=Sampling(exact_border=True),
        disturbance=(0.03, 0.03),
    )


@pytest.fixture(scope="module")
def noisy():
    return scenes.random_scene(
        3, rgb=2, depth=1, lidar3d=2, collections=8, disturbance=(0.03, 0.03)
    )


def true_pose(scene, link):
    true = with_truth(scene.dataset, scene.truth)
    first = next(iter(true.collections.values()))
    frames = (true.sensors[name].frame for name in (link.target, link.source))
    return pose(first, true.graph, *frames)


def off(scene, link):
    return pose_difference(true_pose(scene, link), link.target_T_source)


def test_opencv_finds_exact_cameras_and_its_dataset_is_evaluated(exact):
    rig = stereo_baseline(exact.dataset)
    (link,) = rig.links
    assert link[:2] == ("rgb_1", "rgb_2") and link.collections == 8
    assert max(off(exact, link)) < 1e-5
    assert rig.placed == ("rgb_1", "rgb_2")
    found = evaluate(rig.dataset, exact.dataset, sensors=["rgb_1", "rgb_2"])
    assert found.averages["rgb-rgb"].values["rms"] < 1e-2


def test_opencv_says_where_it_cannot_run(exact):
    labels = {("rgb_2", BOARD): None}
    apart = exact.dataset
    for key in apart.collections:
        apart = apart.with_labels(key, labels)
    rig = stereo_baseline(apart)
    assert not rig.links and rig.dataset is None
    assert "no image pair in which both see 6 corners" in rig.unsolved["rgb_1", "rgb_2"]


def test_boards_seen_in_part_count_with_their_common_corners(exact):
    dataset = exact.dataset
    for key, collection in dataset.collections.items():
        label = collection.labels.get(("rgb_1", BOARD))
        if label is None:
            continue
        left = label.ids % 2 == 0
        half = replace(label, ids=label.ids[left], pixels=label.pixels[left])
        dataset = dataset.with_labels(key, {("rgb_1", BOARD): half})
    (link,) = stereo_baseline(dataset).links
    assert link.collections == 8 and max(off(exact, link)) < 1e-5


def test_corners_on_a_line_do_not_count(exact):
    dataset = exact.dataset
    for key, collection in dataset.collections.items():
        label = collection.labels.get(("rgb_1", BOARD))
        if label is None:
            continue
        row = label.ids < 8
        line = replace(label, ids=label.ids[row], pixels=label.pixels[row])
        dataset = dataset.with_labels(key, {("rgb_1", BOARD): line})
    assert not stereo_baseline(dataset).links


def test_pairs_by_themselves_find_exact_sensors(exact):
    rig = pairwise_baseline(exact.dataset)
    assert len(rig.links) == 10 and not rig.unsolved
    assert set(rig.placed) == set(exact.dataset.sensors)
    for link in rig.links:
        metres, radians = off(exact, link)
        # Limit points of the depth camera lie up to a pixel inside the border.
        limit = 0.02 if "depth_1" in link[:2] else 0.002
        assert metres < limit and radians < limit, link


def test_pairs_without_a_common_board_are_told():
    scene = scenes.disconnected(0, collections=8, noise=Noise.none())
    rig = pairwise_baseline(scene.dataset)
    assert rig.unsolved["rgb_1", "rgb_3"] == "they share no board"
    assert any("nothing links" in remark for remark in rig.remarks)
    assert "rgb_3" not in rig.placed


def test_pairs_of_which_one_tells_no_boards_name_it(exact):
    """As where clouds are absent, or a scan is a line: it was "0 boards that both tell" alone."""
    dataset = exact.dataset.selected(sensors=["rgb_1", "lidar_1"])
    count = len(seen_by_both(dataset, "lidar_1", "rgb_1"))
    without = replace(dataset, data=DataSource())
    why = pairwise_baseline(without).unsolved["lidar_1", "rgb_1"]
    assert why == (
        f"0 boards that both tell; it takes 3 ('lidar_1' by itself tells 0 of {count}, its data "
        f"files are absent and 'rgb_1' by itself tells {count} of {count})"
    )


def test_icp_carries_a_cloud_back_onto_itself(exact):
    cloud = whole_cloud(exact.dataset, "000", "lidar_1")
    move = se3.random_move(0.02, 0.01, np.random.default_rng(0))
    found = registered([Clouds(se3.apply(se3.inverse(move), cloud), cKDTree(cloud))], np.eye(4))
    assert found.rms_m < 1e-6
    np.testing.assert_allclose(found.target_T_source, move, atol=1e-6)


@pytest.mark.long
def test_icp_has_the_papers_variants_and_one_over_all(exact):
    names = ["lidar_1", "lidar_2", "depth_1"]
    dataset = exact.dataset.selected(sensors=names, collections=["000", "001", "002", "003"])
    rigs = {rig.method: rig for rig in icp_baselines(dataset, dataset)}
    assert tuple(rigs) == METHODS and len(METHODS) == 5
    pairs = {("lidar_1", "lidar_2"), ("lidar_1", "depth_1"), ("lidar_2", "depth_1")}
    for rig in rigs.values():
        assert {link[:2] for link in rig.links} <= pairs and rig.links
    without = {rig.method: rig for rig in icp_baselines(dataset)}
    assert not without["icp_initial_best"].links
    assert "--initial" in without["icp_initial_best"].unsolved["lidar_1", "lidar_2"]
    together = rigs["icp_aligned_all"].links[0]
    assert off(exact, together)[0] < 0.1


def test_the_mean_of_poses_is_that_of_most():
    rng = np.random.default_rng(1)
    middle = se3.random_move(1.0, 2.5, rng)
    near = [middle @ se3.random_move(0.001, 0.001, rng) for _ in range(6)]
    found = usual_pose([*near, middle @ se3.random_move(0.5, 1.0, rng)])
    assert max(pose_difference(middle, found)) < 0.001


def test_a_motion_is_told_by_three_points_that_are_no_line():
    rng = np.random.default_rng(2)
    move, points = se3.random_move(1.0, 1.0, rng), rng.standard_normal((3, 3))
    np.testing.assert_allclose(motion_between(points, se3.apply(move, points)), move, atol=1e-9)
    assert motion_between(points[:2], points[:2]) is None
    line = np.outer(np.arange(4.0), [1.0, 2.0, 3.0])
    assert motion_between(line, line) is None


def test_a_rig_goes_along_the_strongest_links(exact):
    dataset = exact.dataset.selected(sensors=["rgb_1", "rgb_2", "lidar_1"])
    true = with_truth(dataset, exact.truth)
    first = next(iter(true.collections.values()))

    def link(source, target, collections, error=0.0):
        frames = (dataset.sensors[name].frame for name in (target, source))
        bad = se3.transform(np.eye(3), np.array([error, 0.0, 0.0]))
        return Link(source, target, bad @ pose(first, true.graph, *frames), collections)

    links = [
        link("lidar_1", "rgb_1", 2, 0.5),
        link("lidar_1", "rgb_2", 9),
        link("rgb_1", "rgb_2", 9),
    ]
    rig = linked_rig("test", dataset, links, {})
    for name in ("rgb_2", "lidar_1"):
        edge = dataset.sensors[name].edge
        np.testing.assert_allclose(
            rig.dataset.first_value(edge), exact.truth.edges[edge], atol=1e-9
        )


def test_sensors_on_one_edge_are_placed_once():
    scene = scenes.shared_edge(0, collections=2, noise=Noise.none())
    poses = {name: np.eye(4) for name in ("rgb_1", "rgb_2", "depth_1")}
    _, placed, remarks = placed_at(scene.dataset, "rgb_1", poses)
    assert placed == ["rgb_1", "rgb_2"] and "shares its edge" in remarks[0]


def test_what_moves_cannot_be_placed_by_one_pose():
    scene = scenes.hand_eye(1, collections=3, noise=Noise.none())
    still = replace(scene.dataset.sensors["rgb_1"], name="still", frame="world")
    dataset = replace(scene.dataset, sensors={**scene.dataset.sensors, "still": still})
    with pytest.raises(DatasetError, match="moves against the parent"):
        edge_value(dataset, "still", "rgb_1", np.eye(4))


def test_the_joint_solution_is_nearer_the_truth(noisy):
    solved = calibrate(noisy.dataset).dataset
    found = evaluate(solved, noisy.dataset, truth=noisy.truth)
    rigs = [stereo_baseline(solved), pairwise_baseline(solved)]
    compared = compare_rigs(rigs, Measured(solved, noisy.dataset, found, noisy.truth))
    for comparison in compared:
        assert comparison.reference == "rgb_1" and comparison.sensors
        ours = np.mean([s.calibration.translation_m for s in comparison.sensors.values()])
        theirs = np.mean([s.error.translation_m for s in comparison.sensors.values()])
        assert ours < theirs
    opencv = compared[0].links[0]
    (pair,) = opencv.pairs
    known = next(r for r in found.pairs if r.pair == pair.pair)
    assert pair.calibration == known.measured.rms and pair.at_truth == known.at_truth.rms
    # Its own rig has the pair where the link has it.
    own = next(r for r in compared[0].evaluation.pairs if r.pair == pair.pair)
    assert pair.rms == pytest.approx(own.measured.rms, rel=1e-6)
