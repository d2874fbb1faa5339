"""ICP of whole clouds: which points take part, what is told by them, and from which start."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from atom_core.evaluation.baselines import icp as module
from atom_core.evaluation.baselines.icp import (
    ALIGNED,
    INITIAL,
    METHODS,
    REACH_M,
    Clouds,
    Registered,
    icp_baselines,
    registered,
    whole_cloud,
)
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import DataSource, pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes

PAIR = ("lidar_1", "lidar_2")


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(
        1, rgb=1, depth=2, lidar3d=3, collections=2, noise=Noise.none()
    ).dataset


class Kept(DataSource):
    """Data by (collection, sensor)."""

    def __init__(self, data):
        self.data = data

    def has_data(self, collection, sensor):
        return (collection, sensor) in self.data

    def read(self, collection, sensor):
        return self.data[collection, sensor]


def with_data(dataset, data):
    return replace(dataset, data=Kept(data))


def shift(*metres):
    return se3.transform(np.eye(3), np.array(metres))


# ---- points


def test_a_cloud_has_all_points_of_which_every_number_is_finite(dataset):
    cloud = np.array([[1.0, 2, 3], [np.nan, 2, 3], [4.0, 5, 6], [1.0, np.inf, 3], [7.0, 8, np.nan]])
    found = whole_cloud(with_data(dataset, {("000", "lidar_1"): cloud}), "000", "lidar_1")
    np.testing.assert_array_equal(found, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


def test_a_depth_image_has_the_points_of_pixels_with_a_positive_depth(dataset):
    camera = Camera(4, 3, np.array([[2.0, 0, 1.5], [0, 4.0, 1.0], [0, 0, 1.0]]))
    sensor = replace(dataset.sensors["depth_1"], camera=camera)
    image = np.full((3, 4), np.nan)
    image[0, 3], image[2, 1], image[1, 1], image[1, 2], image[1, 3] = 2.0, 0.5, 0.0, -1.0, np.inf
    small = replace(
        with_data(dataset, {("000", "depth_1"): image}),
        sensors={**dataset.sensors, "depth_1": sensor},
    )
    found = whole_cloud(small, "000", "depth_1")
    wanted = [
        [2.0 * (3 - 1.5) / 2.0, 2.0 * (0 - 1.0) / 4.0, 2.0],
        [0.5 * (1 - 1.5) / 2.0, 0.5 * (2 - 1.0) / 4.0, 0.5],
    ]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def cloud_of(count):
    return np.arange(3.0 * count).reshape(-1, 3)


@pytest.mark.parametrize("counts, used", [((10, 10), 1), ((9, 10), 0), ((10, 9), 0)])
def test_ten_points_of_both_are_enough(dataset, counts, used):
    data = {("001", name): cloud_of(count) for name, count in zip(PAIR, counts)}
    assert len(module._clouds(with_data(dataset, data), *PAIR)) == used


@pytest.mark.parametrize("missing", PAIR)
def test_a_collection_without_data_of_both_costs_the_later_ones_nothing(dataset, missing):
    data = {(key, name): cloud_of(10) for key in dataset.collections for name in PAIR}
    del data["000", missing]
    assert len(module._clouds(with_data(dataset, data), *PAIR)) == 1


@pytest.mark.parametrize(
    "count, left", [(3999, 3999), (4000, 4000), (4001, 2001), (8000, 4000), (8001, 2667)]
)
def test_of_more_than_four_thousand_points_the_source_is_thinned_evenly(dataset, count, left):
    data = {("000", PAIR[0]): cloud_of(count), ("000", PAIR[1]): cloud_of(count) + 0.5}
    ((source, target),) = module._clouds(with_data(dataset, data), *PAIR)
    assert len(source) == left and target.n == count
    assert len({float(s) for s in np.diff(source[:, 0])}) == 1 and source[0, 0] == 0.0
    np.testing.assert_array_equal(target.data[0], [0.5, 1.5, 2.5])


# ---- registration


def corners(metres=1.0):
    """Return places that are as far apart as a cube's corners."""
    steps = np.array([0.0, metres])
    return np.array([[x, y, z] for x in steps for y in steps for z in steps])


def clouds(source, target):
    return Clouds(np.asarray(source), cKDTree(target))


@pytest.mark.parametrize("move_m, found", [(0.099, True), (0.101, False)])
def test_points_farther_than_the_reach_are_no_counterparts(move_m, found):
    assert REACH_M == 0.1
    result = registered([clouds(corners(), corners() + [move_m, 0.0, 0.0])], np.eye(4))
    assert (result is not None) == found
    if found:
        np.testing.assert_allclose(result.target_T_source, shift(move_m, 0, 0), atol=1e-9)
        assert result.rms_m < 1e-9


def test_it_begins_at_the_start():
    start = se3.random_move(2.0, 1.0, np.random.default_rng(0))
    move = start @ shift(0.03, 0.02, -0.01)
    result = registered([clouds(corners(), se3.apply(move, corners()))], start)
    np.testing.assert_allclose(result.target_T_source, move, atol=1e-9)


@pytest.mark.parametrize("near, told", [(3, True), (2, False), (0, False)])
def test_three_counterparts_tell_a_motion(near, told):
    target = corners() + 0.01
    target[near:] += 10.0
    # The three lie at (0, 0, 0), (0, 0, 1), (0, 1, 0).
    assert (registered([clouds(corners(), target)], np.eye(4)) is not None) == told


def test_the_motion_is_that_of_least_squares_over_all_collections():
    """Sources in one place, targets 2 and 6 cm off: together 4 cm off, and 2 cm remain of each."""
    pairs = [clouds(corners(), corners() + [x, 0.0, 0.0]) for x in (0.02, 0.06)]
    result = registered(pairs, np.eye(4))
    np.testing.assert_allclose(result.target_T_source, shift(0.04, 0.0, 0.0), atol=1e-9)
    assert result.rms_m == pytest.approx(0.02)


def test_a_collection_counts_by_its_points():
    cube = corners() - 0.5
    two = np.vstack([cube, 3.0 * cube])
    pairs = [clouds(two, two), clouds(cube, cube + [0.03, 0.0, 0.0])]
    result = registered(pairs, np.eye(4))
    np.testing.assert_allclose(
        result.target_T_source, shift(0.03 * len(cube) / (3 * len(cube)), 0.0, 0.0), atol=1e-9
    )


def test_the_rms_is_of_counterparts_alone_at_the_pose_that_is_told():
    rng = np.random.default_rng(2)
    source = corners()
    target = source + rng.normal(0.0, 0.01, source.shape)
    stray = np.vstack([source, [[50.0, 0.0, 0.0]]])
    result = registered([clouds(stray, target)], np.eye(4))
    distance = np.linalg.norm(se3.apply(result.target_T_source, source) - target, axis=1)
    assert result.rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-5)
    # No other motion leaves less.
    for step in np.vstack([np.eye(3), -np.eye(3)]):
        other = se3.apply(shift(*(1e-3 * step)) @ result.target_T_source, source) - target
        assert np.sum(other**2) > np.sum(distance**2)


def least_squares_motion(source, target):
    """Return the motion (4, 4) that leaves least (Kabsch)."""
    middles = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - middles[1]).T @ (source - middles[0]))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return se3.transform(turn, middles[1] - turn @ middles[0])


def test_it_goes_on_while_more_points_find_a_counterpart():
    """The near points, which are off, bring the next ones within reach, and those the last."""
    turn = se3.rotation_from_rotation_vector(np.array([0.0, 0.0, 0.1]))
    row = np.array([[x, y, 0.0] for x in (0.3, 0.6, 0.9, 4.0, 9.0) for y in (0.0, 0.5)])
    target = row @ turn.T
    target[:6, 1] += 0.012 * np.repeat([-1.0, 0.0, 1.0], 2)
    near = least_squares_motion(row[:6], target[:6])
    left = np.linalg.norm(se3.apply(near, row) - target, axis=1)
    assert left[6] < REACH_M < left[8]
    result = registered([clouds(row, target)], np.eye(4))
    np.testing.assert_allclose(result.target_T_source, least_squares_motion(row, target), atol=1e-9)


def test_it_goes_on_until_another_step_moves_nothing():
    """Points so dense that the nearest ones are the wrong ones at first."""
    rng = np.random.default_rng(1)
    source = rng.uniform(-0.15, 0.15, (200, 3))
    target = se3.apply(se3.random_move(0.05, 0.1, rng), source)
    first = registered([clouds(source, target)], np.eye(4))
    tree = cKDTree(target)
    for start, settled in ((np.eye(4), False), (first.target_T_source, True)):
        distance, index = tree.query(se3.apply(start, source))
        assert np.all(distance < REACH_M)
        step = least_squares_motion(source, target[index])
        assert np.allclose(step, start, atol=1e-6) == settled


@pytest.mark.parametrize("most", [1, 2, 3])
def test_the_rms_is_that_of_its_pose_also_where_it_did_not_settle(monkeypatch, most):
    monkeypatch.setattr(module, "_ITERATIONS", most)
    rng = np.random.default_rng(1)
    source = rng.uniform(-0.15, 0.15, (200, 3))
    target = se3.apply(se3.random_move(0.05, 0.1, rng), source)
    result = registered([clouds(source, target)], np.eye(4))
    distance, _ = cKDTree(target).query(se3.apply(result.target_T_source, source))
    assert result.rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-9)


# ---- pairs and variants


def test_lidars_are_paired_with_each_other_and_with_depth_cameras(dataset):
    assert module._pairs(dataset) == [
        ("lidar_1", "lidar_2"),
        ("lidar_1", "lidar_3"),
        ("lidar_2", "lidar_3"),
        *((f"lidar_{i}", f"depth_{j}") for i in (1, 2, 3) for j in (1, 2)),
    ]


def variants(monkeypatch, dataset, *, start=None, initial=None, results=(), whole=None):
    """Return each method's answer for a pair, and the starts from which clouds were registered."""
    starts, each = [], iter(results)

    def answers(pairs, start):
        starts.append((len(pairs), start))
        return whole if len(pairs) > 1 else next(each)

    monkeypatch.setattr(module, "aligned_by_boards", lambda *args: start)
    monkeypatch.setattr(module, "registered", answers)
    data = {(key, name): cloud_of(10) for key in dataset.collections for name in PAIR}
    return module._of_pair(with_data(dataset, data), initial, *PAIR), starts


RESULTS = (Registered(shift(0.2, 0, 0), 0.03), Registered(shift(0.4, 0, 0), 0.02))


def test_the_average_is_of_all_collections_and_the_best_has_the_least_rms(monkeypatch, dataset):
    whole = Registered(shift(0.9, 0, 0), 0.05)
    found, starts = variants(
        monkeypatch, dataset, start=shift(1, 0, 0), results=RESULTS, whole=whole
    )
    for method, x_m, count in (("average", 0.3, 2), ("best", 0.4, 1), ("all", 0.9, 2)):
        link = found[f"icp_{ALIGNED}_{method}"]
        assert link[:2] == PAIR and link.collections == count
        np.testing.assert_allclose(link.target_T_source, shift(x_m, 0, 0), atol=1e-12)
    assert [count for count, _ in starts] == [1, 1, 2]
    assert all(np.array_equal(start, shift(1, 0, 0)) for _, start in starts)
    why = "give the dataset before it was calibrated as --initial"
    assert {found[f"icp_{INITIAL}_{m}"] for m in ("average", "best")} == {why}


def test_from_the_initial_dataset_there_is_no_variant_over_all(monkeypatch, dataset):
    found, starts = variants(monkeypatch, dataset, initial=dataset, results=RESULTS)
    assert set(found) == set(METHODS) and [count for count, _ in starts] == [1, 1]
    first, graph = dataset.collections["000"], dataset.graph
    frames = (dataset.sensors[name].frame for name in reversed(PAIR))
    np.testing.assert_allclose(starts[0][1], pose(first, graph, *frames), atol=1e-12)
    assert found["icp_initial_best"].collections == 1
    why = "they share too few boards to be put together"
    assert {found[m] for m in METHODS if ALIGNED in m} == {why}


@pytest.mark.parametrize("lost", PAIR)
def test_an_initial_dataset_without_one_of_the_two_gives_no_start(dataset, lost):
    fewer = dataset.selected(sensors=[name for name in dataset.sensors if name != lost])
    assert module._initial_pose(fewer, *PAIR) is None


def test_collections_without_counterparts_are_not_in_the_average(monkeypatch, dataset):
    found, _ = variants(
        monkeypatch, dataset, start=np.eye(4), results=(None, RESULTS[1]), whole=RESULTS[0]
    )
    assert [found[f"icp_aligned_{m}"].collections for m in ("average", "best", "all")] == [1, 1, 2]
    np.testing.assert_allclose(found["icp_aligned_average"].target_T_source, shift(0.4, 0, 0))


def test_a_start_without_counterparts_costs_the_other_start_nothing(monkeypatch, dataset):
    results = (None, None, *RESULTS)
    found, _ = variants(
        monkeypatch,
        dataset,
        start=np.eye(4),
        initial=dataset,
        results=results,
        whole=RESULTS[0],
    )
    why = "no counterparts within 0.1 m"
    assert {found[m] for m in METHODS if INITIAL in m} == {why}
    assert found["icp_aligned_average"].collections == 2


def test_no_data_of_both_and_a_pair_that_moves_are_told_for_all_methods(dataset):
    blind = with_data(dataset, {})
    why = dict.fromkeys(METHODS, "no collection has data of both")
    assert module._of_pair(blind, None, *PAIR) == why
    edge = Edge("rig_base", "lidar_2_post")
    moved = dataset.first_value(edge) @ shift(0.1, 0.0, 0.0)
    swinging = dataset.with_transforms({"001": {edge: moved}})
    why = dict.fromkeys(METHODS, "they move against each other")
    assert module._of_pair(swinging, None, *PAIR) == why


def test_every_method_has_the_links_and_the_reasons_of_all_pairs(monkeypatch, dataset):
    def of_pair(dataset, initial, source, target):
        solved = module.Link(source, target, np.eye(4), 1)
        return {m: solved if (m == METHODS[1]) == (source == "lidar_1") else m for m in METHODS}

    monkeypatch.setattr(module, "_of_pair", of_pair)
    few = dataset.selected(sensors=["lidar_1", "lidar_2", "lidar_3"])
    rigs = icp_baselines(few)
    assert [rig.method for rig in rigs] == list(METHODS)
    of_first, of_second = [("lidar_1", "lidar_2"), ("lidar_1", "lidar_3")], [("lidar_2", "lidar_3")]
    for rig in rigs:
        solved, unsolved = of_second, of_first
        if rig.method == METHODS[1]:
            solved, unsolved = of_first, of_second
        assert [link[:2] for link in rig.links] == solved
        assert rig.unsolved == dict.fromkeys(unsolved, rig.method)


# ---- alignment by boards


def aligned(monkeypatch, sides):
    """Return the motion that puts middles (3,) of boards together; None: not told."""
    keys = [((i, "one"), (i, "other")) for i in range(len(sides))]
    middles = {key: side for pair, both in zip(keys, sides) for key, side in zip(pair, both)}
    monkeypatch.setattr(module, "seen_by_both", lambda *args: keys)
    monkeypatch.setattr(module, "board_middle", lambda dataset, key: middles[key])
    return module.aligned_by_boards(SimpleNamespace(), "one", "other")


def test_the_middles_of_boards_that_both_tell_lie_on_one_another(monkeypatch):
    move = se3.random_move(1.0, 1.0, np.random.default_rng(6))
    sides = [(p, se3.apply(move, p[None])[0]) for p in corners()[:4]]
    wrong = [(None, np.ones(3)), (np.ones(3), None)]
    np.testing.assert_allclose(aligned(monkeypatch, [*wrong, *sides]), move, atol=1e-9)
    assert aligned(monkeypatch, [*sides[:2], *wrong]) is None
    assert aligned(monkeypatch, wrong) is None and aligned(monkeypatch, []) is None
