"""Pairs of sensors on synthetic data: nothing at the truth, known errors in the known amount."""

import time
from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError, SelectionError
from atom_core.evaluation import observed
from atom_core.evaluation.annotation_check import misplaced_annotations
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.mixed import mixed_dataset
from atom_core.evaluation.pairs import pair_kinds, pairs_of
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane
from atom_core.geometry.polyline import segments_of
from atom_core.model.dataset import MULTIPLE, DataSource, range_points
from atom_core.model.dataset import pose as pose_of
from atom_core.model.labels import DetectionKey, RangeLabel
from atom_core.model.truth import Truth
from atom_core.synthetic import Noise, Sampling, paper_cell
from atom_core.synthetic.scenes import random_scene, two_cameras, two_patterns

PATTERN = "pattern_1"


@pytest.fixture(scope="module")
def exact():
    """The paper's cell without noise, limit points on the true border."""
    return paper_cell(3, "test", Noise.none(), sampling=Sampling(exact_border=True))


@pytest.fixture(scope="module")
def noisy():
    return paper_cell(3, "test")


def moved(dataset, sensor, parent_T_parent):
    """Return the dataset with the edge of a sensor moved, as seen in the edge's parent."""
    edge = dataset.sensors[sensor].edge
    first = next(iter(dataset.collections.values())).transforms[edge]
    return dataset.with_transforms(
        dict.fromkeys(dataset.collections, {edge: parent_T_parent @ first})
    )


def by_pair(evaluation):
    return {(r.pair.kind.name, r.pair.source, r.pair.target): r for r in evaluation.pairs}


def test_metrics_vanish_at_the_truth_without_noise(exact):
    evaluation = evaluate(exact.dataset, exact.dataset, pairs=["rgb_*:rgb_*", "lidar_*:*"])
    limits = {"rgb-rgb": 1e-5, "lidar3d-rgb": 1e-3, "lidar3d-lidar3d_plane": 1e-6}
    for kind, limit in limits.items():
        results = [r for r in evaluation.pairs if r.pair.kind.name == kind]
        assert results and all(r.measured.rms < limit for r in results)


def test_raw_limit_points_lie_up_to_a_beam_step_inside_the_border():
    cell = paper_cell(3, "test", Noise.none())
    evaluation = evaluate(cell.dataset, cell.dataset, pairs=["lidar_*:rgb_*", "depth_1:*"])
    for kind, limit_px in (("lidar3d-rgb", 4.0), ("depth-rgb", 3.0), ("lidar3d-depth", 2.0)):
        assert 0.1 < evaluation.averages[kind].values["rms"] < limit_px


def test_at_truth_is_the_metric_with_the_true_edges(noisy):
    disturbed = paper_cell(3, "test", disturbance=(0.05, 0.03))
    evaluation = evaluate(disturbed.dataset, noisy.dataset, truth=noisy.truth)
    at_truth = evaluate(noisy.dataset, noisy.dataset)
    for found, expected in zip(evaluation.pairs, at_truth.pairs):
        assert found.pair == expected.pair
        assert found.at_truth.rms == pytest.approx(expected.measured.rms, rel=1e-6)
        if found.pair.kind.unit == "px":
            assert found.measured.rms > 2 * found.at_truth.rms
    floor = evaluation.averages["rgb-rgb"].at_truth
    assert floor == pytest.approx(at_truth.averages["rgb-rgb"].values["rms"])


def test_rgb_rgb_grows_by_what_the_target_camera_is_turned(exact, monkeypatch):
    # ATOM's single-precision intrinsics limit the poses to about 1e-6; here the formula is tested.
    monkeypatch.setattr(observed, "_in_single_precision", lambda camera: camera)
    rgb_1 = exact.dataset.sensors["rgb_1"]
    collection = next(iter(exact.dataset.collections.values()))
    graph = exact.dataset.graph
    parent_T_optical = pose_of(collection, graph, rgb_1.edge.parent, rgb_1.frame)
    turn = se3.transform(se3.rotation_from_rotation_vector(np.array([0, 0.002, 0])), np.zeros(3))
    train = moved(exact.dataset, "rgb_1", parent_T_optical @ turn @ se3.inverse(parent_T_optical))
    result = by_pair(evaluate(train, exact.dataset))[("rgb-rgb", "rgb_3", "rgb_1")]
    for key, figures in result.measured.per_collection.items():
        ids = exact.dataset.collections[key].labels[("rgb_1", PATTERN)].ids
        common = np.intersect1d(ids, exact.dataset.collections[key].labels[("rgb_3", PATTERN)].ids)
        camera_T_board = (
            pose_of(exact.dataset.collections[key], graph, rgb_1.frame, "world")
            @ exact.truth.boards[(PATTERN, key)]
        )
        points = se3.apply(camera_T_board, exact.dataset.patterns[PATTERN].corners_of(common))
        shift = rgb_1.camera.project(se3.apply(se3.inverse(turn), points)) - rgb_1.camera.project(
            points
        )
        expected = np.sqrt(np.mean(np.sum(shift**2, axis=1)))
        assert figures.rms == pytest.approx(expected, rel=1e-6)
        assert figures.rotation_deg == pytest.approx(np.degrees(0.002), rel=1e-6)


def test_point_to_plane_sees_20_mm(exact):
    dataset = exact.dataset
    key = next(
        k.collection
        for k, _ in dataset.detections()
        if k.sensor == "lidar_1"
        and ("lidar_2", PATTERN) in dataset.collections[k.collection].labels
    )
    lidar_2 = dataset.sensors["lidar_2"]
    board = range_points(dataset, DetectionKey(key, "lidar_2", PATTERN)).inside
    parent_T_lidar = pose_of(
        dataset.collections[key], dataset.graph, lidar_2.edge.parent, lidar_2.frame
    )
    normal = parent_T_lidar[:3, :3] @ fit_plane(board)[1]
    train = moved(dataset, "lidar_2", se3.transform(np.eye(3), 0.020 * normal))
    results = by_pair(evaluate(train, dataset, pairs=["lidar_1:lidar_2"]))
    for names in (("lidar_1", "lidar_2"), ("lidar_2", "lidar_1")):
        figures = results[("lidar3d-lidar3d_plane", *names)].measured.per_collection[key]
        assert figures.rms == pytest.approx(20.0, abs=1e-6)
    assert results[("lidar3d-lidar3d_plane", "lidar_2", "lidar_1")].pair.reverse


def test_rms_is_the_unweighted_mean_and_the_pooled_one_stands_beside(noisy):
    evaluation = evaluate(noisy.dataset, noisy.dataset, pairs=["rgb_1:rgb_3"])
    for result in evaluation.pairs:
        parts = list(result.measured.per_collection.values())
        assert result.measured.rms == pytest.approx(np.mean([p.rms for p in parts]))
        square = sum(p.points * p.rms**2 for p in parts) / sum(p.points for p in parts)
        assert result.measured.pooled.rms == pytest.approx(np.sqrt(square))


def test_averages_leave_reverse_pairs_out(noisy):
    evaluation = evaluate(noisy.dataset, noisy.dataset)
    counted = {kind: average.pairs for kind, average in evaluation.averages.items()}
    assert counted == {
        "rgb-rgb": 3,
        "lidar3d-rgb": 9,
        "lidar3d-rgb_plane": 9,
        "depth-rgb": 3,
        "depth-rgb_plane": 3,
        "lidar3d-depth": 3,
        "lidar3d-depth_plane": 3,
        "lidar3d-lidar3d": 3,
        "lidar3d-lidar3d_common": 3,
        "lidar3d-lidar3d_limit": 3,
        "lidar3d-lidar3d_plane": 3,
    }
    forward = [
        r.measured.rms
        for r in evaluation.pairs
        if r.pair.kind.name == "rgb-rgb" and not r.pair.reverse
    ]
    assert evaluation.averages["rgb-rgb"].values["rms"] == pytest.approx(np.mean(forward))


@pytest.mark.long
def test_the_paper_cell_takes_seconds(noisy):
    start = time.process_time()
    evaluate(noisy.dataset, noisy.dataset, truth=noisy.truth)
    assert time.process_time() - start < 10.0


def test_several_depth_sensors_are_compared_with_each_other():
    scene = random_scene(1, rgb=0, depth=2, lidar3d=0, noise=Noise.none())
    evaluation = evaluate(scene.dataset, scene.dataset)
    assert [(r.pair.kind.name, r.pair.reverse) for r in evaluation.pairs] == [
        (kind, reverse)
        for kind in ("depth-depth", "depth-depth_plane")
        for reverse in (False, True)
    ]
    assert all(r.measured.rms < 2.0 for r in evaluation.pairs)


def test_patterns_are_measured_one_by_one_and_pooled_by_collection():
    scene = two_patterns(0, noise=Noise.none())
    both = evaluate(scene.dataset, scene.dataset, pairs=["rgb_1:rgb_2"]).pairs[0]
    assert {row.pattern for row in both.measured.rows} == {"left"}
    assert both.measured.rms < 1e-5
    other = evaluate(scene.dataset, scene.dataset, pairs=["depth_1:rgb_2"]).pairs[0]
    assert {row.pattern for row in other.measured.rows} == {"right"}
    nothing = evaluate(scene.dataset, scene.dataset, pairs=["depth_1:rgb_1"]).pairs[0]
    assert "no collection in which 'depth_1' and 'rgb_1' detect the same pattern" in nothing.skipped


def test_cameras_without_a_common_corner_are_skipped():
    dataset = two_cameras(0, noise=Noise.none()).dataset
    collections = {}
    for key, collection in dataset.collections.items():
        labels = dict(collection.labels)
        for sensor, even in (("rgb_1", 0), ("rgb_2", 1)):
            label = labels.get((sensor, PATTERN))
            if label is None:
                continue
            chosen = label.ids % 2 == even
            labels[(sensor, PATTERN)] = replace(
                label, ids=label.ids[chosen], pixels=label.pixels[chosen]
            )
        collections[key] = replace(collection, labels=labels)
    apart = replace(dataset, collections=collections)
    evaluation = evaluate(apart, apart)
    assert not evaluation.measured
    assert "no corner in common" in evaluation.pairs[0].skipped


def test_collections_that_cannot_be_measured_are_named(noisy):
    dataset = noisy.dataset
    key = next(k.collection for k, _ in dataset.detections() if k.sensor == "depth_1")
    collection = dataset.collections[key]
    label = collection.labels[("depth_1", PATTERN)]
    bare = RangeLabel(label.indices, np.zeros(0, dtype=int))
    changed = replace(collection, labels={**collection.labels, ("depth_1", PATTERN): bare})
    test = replace(dataset, collections={**dataset.collections, key: changed})
    results = evaluate(test, test, pairs=["depth_1:rgb_*"]).pairs
    assert all(r.measured for r in results)
    named = [r.unmeasured[key] for r in results if key in r.unmeasured]
    assert named and set(named) == {"'depth_1' has no labeled limit points"}


def test_absent_data_are_skipped_and_the_rest_is_measured(noisy):
    bare = replace(noisy.dataset, data=DataSource())
    evaluation = evaluate(bare, bare)
    for result in evaluation.pairs:
        if result.pair.kind.name == "rgb-rgb":
            assert result.measured
        else:
            assert "is absent" in result.skipped
    assert set(evaluation.averages) == {"rgb-rgb"}


def test_hand_annotations_come_before_the_boards_pose(exact):
    key = next(
        k.collection
        for k, _ in exact.dataset.detections()
        if k.sensor == "lidar_1"
        and ("rgb_3", PATTERN) in exact.dataset.collections[k.collection].labels
    )
    annotation = {(key, "rgb_3", PATTERN): np.array([[[0.0, 0.0], [0.0, 700.0]]])}
    plain = evaluate(exact.dataset, exact.dataset, pairs=["lidar_1:rgb_3"]).pairs[0]
    drawn = evaluate(
        exact.dataset, exact.dataset, pairs=["lidar_1:rgb_3"], annotations=annotation
    ).pairs[0]
    assert plain.measured.per_collection[key].rms < 1e-3
    assert drawn.measured.per_collection[key].rms > 50.0
    others = [k for k in plain.measured.per_collection if k != key]
    assert all(drawn.measured.per_collection[k].rms < 1e-3 for k in others)


@pytest.mark.parametrize("sensor", ["rgb_3", "depth_1"])
@pytest.mark.parametrize(
    "shift_px, sides, is_doubted",
    [(0.0, 4, False), (3.0, 4, False), (0.0, 1, False), (60.0, 4, True), (90.0, 2, True)],
)
def test_a_border_that_is_drawn_elsewhere_is_told(noisy, sensor, shift_px, sides, is_doubted):
    dataset, seen = noisy.dataset, observed.Observed(noisy.dataset)
    key = next(k for k, _ in dataset.detections() if k.sensor == sensor)
    if sensor == "depth_1":
        pixels = seen.limit_pixels(key)
        ends = pixels[[np.argmin(pixels[:, 0]), np.argmin(pixels[:, 1])]]
        ends = np.concatenate([ends, pixels[[np.argmax(pixels[:, 0]), np.argmax(pixels[:, 1])]]])
        border = segments_of(ends, closed=True)[:sides]
    else:
        border = seen.border(key)
        border = border[: sides * len(border) // 4]
    drawn = {(key.collection, sensor, key.pattern): border + shift_px}
    nowhere = {("017", sensor, key.pattern): border, (key.collection, sensor, "none"): border}
    told = misplaced_annotations(dataset, {**drawn, **nowhere})
    assert len(told) == is_doubted
    if told:
        assert f"annotation_{sensor}.json" in told[0] and f"collection {key.collection}" in told[0]


# -------------------------------------------------------------------------- the mixed dataset


def test_mixed_dataset_takes_edges_and_intrinsics_of_the_train_file(noisy):
    train = paper_cell(3, "train", disturbance=(0.1, 0.1)).dataset
    camera = train.sensors["rgb_1"].camera
    better = replace(
        train.sensors["rgb_1"], camera=replace(camera, K=camera.K * [[1.01], [1], [1]])
    )
    train = replace(train, sensors={**train.sensors, "rgb_1": better})
    mixed = mixed_dataset(train, noisy.dataset)
    wanted = next(iter(train.collections.values())).transforms
    for collection in mixed.collections.values():
        for sensor in mixed.sensors.values():
            np.testing.assert_array_equal(collection.transforms[sensor.edge], wanted[sensor.edge])
    assert mixed.sensors["rgb_1"].camera is better.camera
    assert list(mixed.collections) == list(noisy.dataset.collections)


@pytest.mark.parametrize("kind", [MULTIPLE, "fixed"])
def test_the_trains_calibration_is_measured_whatever_the_type_of_a_sensors_edge_is(noisy, kind):
    train = paper_cell(3, "train", disturbance=(0.1, 0.1)).dataset
    edge = train.sensors["rgb_1"].edge
    train = replace(train, edge_types={**train.edge_types, edge: kind})
    mixed = mixed_dataset(train, noisy.dataset)
    for collection in mixed.collections.values():
        np.testing.assert_array_equal(collection.transforms[edge], train.first_value(edge))


@pytest.mark.parametrize("reduce_train", [True, False])
def test_other_sensors_are_refused_by_name_unless_they_are_left_out(noisy, reduce_train):
    names = [n for n in noisy.dataset.sensors if n != "lidar_2"]
    fewer = noisy.dataset.selected(sensors=names)
    train, test = (fewer, noisy.dataset) if reduce_train else (noisy.dataset, fewer)
    with pytest.raises(DatasetError, match="sensor 'lidar_2'.*-ssf '!lidar_2'"):
        evaluate(train, test)
    assert list(mixed_dataset(train, test, names).sensors) == names


def test_another_edge_for_the_same_sensor_is_refused(noisy):
    sensor = noisy.dataset.sensors["rgb_1"]
    other = replace(sensor, edge=sensor.edge._replace(child="elsewhere"))
    test = replace(noisy.dataset, sensors={**noisy.dataset.sensors, "rgb_1": other})
    with pytest.raises(DatasetError, match="'rgb_1'.*elsewhere"):
        evaluate(noisy.dataset, test)


def test_a_truth_without_an_edge_is_refused(noisy):
    with pytest.raises(DatasetError, match="the truth lacks edge"):
        evaluate(noisy.dataset, noisy.dataset, truth=Truth({}))


# ------------------------------------------------------------------------------ which pairs


def test_pairs_go_source_before_target_in_the_order_of_the_configuration(noisy):
    pairs = pairs_of(noisy.dataset.sensors)
    order = list(noisy.dataset.sensors)
    for pair in pairs:
        if pair.kind.source == pair.kind.target:
            assert pair.reverse == (order.index(pair.source) > order.index(pair.target))
    reversible = {pair.kind.name for pair in pairs if pair.reverse}
    assert reversible == {"rgb-rgb", "lidar3d-lidar3d_limit", "lidar3d-lidar3d_plane"}
    assert {pair.kind.name for pair in pairs} == {
        k.name for k in pair_kinds() if {k.source, k.target} <= {"rgb", "depth", "lidar3d"}
    } - {"depth-depth", "depth-depth_plane"}


@pytest.mark.parametrize("text", ["rgb_1:lidar_2", "lidar_2:rgb_1"])
def test_a_pair_may_be_named_in_either_order(noisy, text):
    pairs = pairs_of(noisy.dataset.sensors, [text])
    assert [pair.kind.name for pair in pairs] == ["lidar3d-rgb", "lidar3d-rgb_plane"]
    assert {(p.source, p.target, p.reverse) for p in pairs} == {("lidar_2", "rgb_1", False)}


@pytest.mark.parametrize("text", ["rgb_1:rgb_9", "depth_1:depth_1"])
def test_a_pair_that_does_not_exist_is_refused(noisy, text):
    with pytest.raises(SelectionError, match=f"{text}: no such pair"):
        pairs_of(noisy.dataset.sensors, [text])


@pytest.mark.parametrize("text", ["rgb_1", "rgb_1:", ":rgb_1", ":", ""])
def test_two_sensors_are_a_pair(noisy, text):
    with pytest.raises(SelectionError, match=f"{text}: write two sensors as A:B"):
        pairs_of(noisy.dataset.sensors, [text])
