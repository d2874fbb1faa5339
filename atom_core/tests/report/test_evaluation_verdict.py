"""What a test set proves of a calibration, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.verdict import GOOD, WEAK, WRONG, verdict_lines
from atom_core.synthetic import scenes
from atom_core.synthetic.scanners import cell_with_scanners


@pytest.mark.parametrize("along", range(3))
@pytest.mark.parametrize("seed", [0, 1])
def test_a_lidar_that_is_off_along_the_boards_of_another_one_is_not_good(seed, along):
    """Planes alone show no shift along them; the boards' tilts tell it."""
    true, train = lidars_apart(seed, 0.1 * np.eye(3)[along], collections=12)
    assert evaluation_verdict(evaluate(true, true)).grade == GOOD
    verdict = evaluation_verdict(evaluate(train, true))
    assert verdict.grade == WRONG, verdict_lines(verdict)


def test_lidars_before_boards_that_all_face_one_way_are_not_good():
    true, train = lidars_apart(1, np.zeros(3), collections=2)
    verdict = evaluation_verdict(evaluate(train, true))
    assert {verdict.grade, *(s.grade for s in verdict.sensors.values())} == {WEAK}
    assert all("tilted" in sensor.advice for sensor in verdict.sensors.values())


def lidars_apart(seed, shift_m, **options):
    """Return two LiDARs where they are, and with the second one shifted along its own axes."""
    scene = scenes.lidar_only(seed, lidar3d=2, **options)
    true = scene.dataset.with_transforms(
        dict.fromkeys(scene.dataset.collections, scene.truth.edges)
    )
    edge = true.sensors["lidar_2"].edge
    off = true.first_value(edge) @ se3.transform(np.eye(3), shift_m)
    return true, true.with_transforms(dict.fromkeys(true.collections, {edge: off}))


@pytest.mark.parametrize(
    "counts",
    [{"rgb": 1, "lidar3d": 1}, {"rgb": 1, "depth": 1}, {"depth": 2}, {"depth": 1, "lidar3d": 1}],
)
def test_a_range_sensor_that_is_off_along_the_rays_of_an_image_is_not_good(counts):
    """Its border hardly moves in the image; its points are off the board's plane."""
    chosen = {"rgb": 0, "depth": 0, "lidar3d": 0, **counts}
    scene = scenes.random_scene(2, collections=10, **chosen)
    true = scene.dataset.with_transforms(
        dict.fromkeys(scene.dataset.collections, scene.truth.edges)
    )
    assert evaluation_verdict(evaluate(true, true)).grade == GOOD
    camera, other = (true.sensors[name] for name in (list(true.sensors)[0], list(true.sensors)[-1]))
    first = next(iter(true.collections.values()))
    along = pose(first, true.graph, other.edge.parent, camera.frame)[:3, 2]
    off = se3.transform(np.eye(3), 0.12 * along) @ true.first_value(other.edge)
    train = true.with_transforms(dict.fromkeys(true.collections, {other.edge: off}))
    verdict = evaluation_verdict(evaluate(train, true))
    assert verdict.grade == WRONG, verdict_lines(verdict)


@pytest.mark.parametrize("shift_m", [0.0, 0.2])
def test_two_scanners_alone_prove_nothing_of_each_other(shift_m):
    scene = cell_with_scanners(0)
    true = scene.dataset.selected(["scanner_1", "scanner_2"])
    edge = true.sensors["scanner_2"].edge
    off = true.first_value(edge) @ se3.transform(np.eye(3), np.array([shift_m, 0.0, 0.0]))
    train = true.with_transforms(dict.fromkeys(true.collections, {edge: off}))
    verdict = evaluation_verdict(evaluate(train, true))
    assert {verdict.grade, *(s.grade for s in verdict.sensors.values())} == {WEAK}
    assert all("proves little" in sensor.sentence for sensor in verdict.sensors.values())


@pytest.mark.parametrize("count, grade", [(0, GOOD), (1, GOOD), (2, GOOD), (4, WEAK), (8, WEAK)])
def test_a_sensor_that_is_off_in_many_collections_is_not_good_since_it_is_right_in_most(
    count, grade
):
    """One bad label is none of the calibration; a camera that was knocked meanwhile is."""
    scene = scenes.two_cameras(3, collections=30)
    true = scene.dataset.with_transforms(
        dict.fromkeys(scene.dataset.collections, scene.truth.edges)
    )
    both = [key for key, collection in true.collections.items() if len(collection.labels) == 2]
    test = true.selected(collections=both)
    for key in both[:count]:
        label = test.collections[key].labels["rgb_2", "pattern_1"]
        knocked = replace(label, pixels=label.pixels + [60.0, 0.0])
        test = test.with_labels(key, {("rgb_2", "pattern_1"): knocked})
    verdict = evaluation_verdict(evaluate(true, test))
    assert verdict.grade == grade, verdict_lines(verdict)
    told = f"in {count} of {len(both)} collections"
    assert all((told in s.sentence) == (grade == WEAK) for s in verdict.sensors.values())
    with_truth = evaluation_verdict(evaluate(true, test, truth=scene.truth))
    assert with_truth.grade == GOOD  # then labels are known to be off, not the calibration
