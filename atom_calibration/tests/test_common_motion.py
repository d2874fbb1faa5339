"""Sensors that move alike while all data are taken: late stamps are in doubt, and that is kept."""

from types import SimpleNamespace

import numpy as np
import pytest

from atom_calibration.collect.collector import Collector, Setup
from atom_calibration.collect.common_motion import LATE_S, CommonMotion
from atom_calibration.collect.selection import Moment, TimedMoments
from atom_calibration.modalities.frames import Frame
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.io.collections import CollectionStore
from atom_core.io.dataset_json import read_dataset
from atom_core.labeling.base import Labeled
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

FIRST_S = 100.0
MOUNT = se3.from_rpy(np.array([0.1, 0.0, 0.2]), np.array([0.2, -0.4, 1.0]))


def tree_of(make, way, last_s=FIRST_S + 20.0):
    """Return the transforms of a flange whose pose in the world is a function of the time."""
    tree = TransformTree(30.0)
    tree.add(make.transforms({Edge("flange", "camera"): MOUNT}, FIRST_S).transforms, fixed=True)
    for stamp_s in np.arange(FIRST_S, last_s, 0.02):
        moving = make.transforms({Edge("world", "flange"): way(stamp_s)}, stamp_s)
        tree.add(moving.transforms, fixed=False)
    return tree


def seen(
    make, way, stamps_s, sensor="camera", parent="world", last_s=FIRST_S + 20.0, at_rest=False
):
    """Return the motion in collections at some times, of a camera and of what its board is on."""
    motion = CommonMotion({"board": SimpleNamespace(parent_frame=parent)})
    tree = tree_of(make, way, last_s)
    for i, stamp_s in enumerate(stamps_s):
        labels = {"board": SimpleNamespace(detected=True)}
        frame = SimpleNamespace(
            sensor=SimpleNamespace(frame=sensor), stamp_s=stamp_s, labels=labels
        )
        motion.add(f"{i:03d}", {"rgb_1": frame}, tree, at_rest)
    return motion


def shifted(metres):
    return se3.transform(np.eye(3), np.array([metres, 0.0, 0.5]))


def swept(t):
    return shifted(0.1 * (t - FIRST_S))


def to_and_fro(t):
    """Sweep for a second one way, for a second the other."""
    u = (t - FIRST_S) % 2.0
    return shifted(0.1 * min(u, 2.0 - u))


STAMPS = FIRST_S + np.arange(1.5, 9.5)


def test_a_camera_that_always_sweeps_one_way_is_in_doubt_with_what_late_stamps_would_do(make):
    (caveat,) = seen(make, swept, STAMPS).caveats
    assert caveat.sensors == ("rgb_1",)
    assert "8 collections were taken, 100 mm/s and 0.0 deg/s in the mean" in caveat.what
    assert f"{1e3 * 0.1 * LATE_S:.1f} mm" in caveat.what
    assert "stop for each picture" in caveat.remedy


def test_so_is_one_that_stands_still_before_a_board_that_an_arm_sweeps(make):
    (caveat,) = seen(make, swept, STAMPS, sensor="world", parent="camera").caveats
    assert "100 mm/s" in caveat.what


def test_and_one_that_always_turns_one_way(make):
    def turning(t):
        return se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, np.radians(10.0) * (t - FIRST_S)]))

    (caveat,) = seen(make, turning, STAMPS).caveats
    assert "10.0 deg/s" in caveat.what and f"{10.0 * LATE_S:.2f} deg" in caveat.what


@pytest.mark.parametrize(
    "way",
    [lambda _t: shifted(0.3), lambda t: shifted(0.01 * (t - FIRST_S)), to_and_fro],
    ids=["at rest", "creeping", "to and fro"],
)
def test_what_stands_creeps_or_moves_both_ways_is_not_in_doubt(make, way):
    assert seen(make, way, STAMPS).caveats == ()


def test_a_stop_after_each_motion_is_rest(make):
    def stops(t):
        whole, rest = divmod(t - FIRST_S, 1.0)
        return shifted(0.1 * (whole + min(rest / 0.3, 1.0)))

    assert seen(make, stops, FIRST_S + np.arange(1.7, 9.7)).caveats == ()


def test_where_labels_show_rest_the_board_rides_along(make):
    assert seen(make, swept, STAMPS, at_rest=True).caveats == ()


def test_collections_that_were_deleted_do_not_count(make):
    motion = seen(make, swept, STAMPS)
    for i in range(1, len(STAMPS)):
        motion.delete(f"{i:03d}")
    assert motion.caveats == ()


def test_where_no_transform_tells_of_the_motion_nothing_is_in_doubt(make):
    assert seen(make, swept, FIRST_S + 100.0 + STAMPS).caveats == ()


def test_the_doubt_is_told_and_kept_with_the_dataset(make, tmp_path):
    dataset = scenes.hand_eye(0, collections=4).dataset
    (name,), (pattern,) = dataset.sensors, dataset.patterns
    sensor, told = dataset.sensors[name], []
    first, last = (dataset.collections[key].transforms for key in ("000", "003"))
    (moving,) = (edge for edge in first if np.ptp([first[edge], last[edge]], axis=0).max() > 1e-3)
    tree = TransformTree(60.0)
    fixed = {edge: T for edge, T in first.items() if edge != moving}
    tree.add(make.transforms(fixed, FIRST_S).transforms, fixed=True)
    for stamp_s in np.arange(FIRST_S, FIRST_S + 10.0, 0.02):
        now = first[moving] @ se3.inverse(shifted(0.0)) @ swept(stamp_s)
        tree.add(make.transforms({moving: now}, stamp_s).transforms, fixed=False)
    store = CollectionStore.create(tmp_path / "out")
    setup = Setup(
        dataset.config,
        dataset.sensors,
        dataset.patterns,
        lambda _: tree,
        store,
        at_stops=False,
        warn=told.append,
    )
    collector = Collector(setup, TimedMoments([], 0.1))
    for i, collection in enumerate(dataset.collections.values()):
        stamp_s = FIRST_S + 2.0 * (i + 0.5)
        frame = Frame(sensor, stamp_s, header(stamp_s), image(sensor))
        frame.set_label(pattern, Labeled(collection.labels[name, pattern]))
        collector.add(frame)
        collector.take(Moment(stamp_s - 0.05, stamp_s + 0.05, stamp_s), asked=True)
    collector.keep_caveats()
    path, _ = store.assemble()
    (caveat,) = read_dataset(path).caveats
    assert "it moved alike while the data of its 4 collections were taken" in caveat.what
    assert caveat.sentence in told


def header(stamp_s):
    nsecs = int(round(1e9 * stamp_s))
    stamp = {"secs": nsecs // 10**9, "nsecs": nsecs % 10**9}
    return {"seq": 0, "stamp": stamp, "frame_id": "cam"}


def image(sensor):
    return np.zeros((sensor.camera.height, sensor.camera.width, 3), np.uint8)
