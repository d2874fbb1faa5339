"""A recording that is played again, in a loop or by hand, gives each stop once."""

import numpy as np
import pytest

from atom_calibration.collect.collector import Collector, Setup
from atom_calibration.collect.conclusion import left_out
from atom_calibration.collect.selection import StopMoments
from atom_calibration.modalities.frames import Frame
from atom_calibration.nodes.collecting.live_collector import LiveCollector
from atom_calibration.sources.receipts import ReceiptTimes
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.io.collections import CollectionStore
from atom_core.labeling.base import Labeled
from atom_core.model.labels import RgbLabel
from atom_core.model.sensor import RGB
from atom_core.synthetic import scenes

DATASET = scenes.two_cameras(0, collections=4).dataset
(PATTERN,) = DATASET.patterns
STOP_S, BEGIN_S = 3.0, 100.0
PLACES = tuple(DATASET.collections)


@pytest.fixture
def setup(make, tmp_path):
    tree = TransformTree(30.0)
    first = DATASET.collections[PLACES[0]]
    tree.add(make.transforms(first.transforms, BEGIN_S).transforms, fixed=True)
    cameras = {name: s for name, s in DATASET.sensors.items() if s.modality == RGB}
    store = CollectionStore.create(tmp_path / "out")
    return Setup(DATASET.config, cameras, DATASET.patterns, lambda _: tree, store)


@pytest.fixture
def collector(setup):
    return Collector(setup, StopMoments(DATASET.patterns))


class Quiet:
    """A board on which nobody looks."""

    def __getattr__(self, _name):
        return lambda *_words: None


def play(collector, places=PLACES, noise_px=0.0, rng=None):
    """Show the board at one place after the other; return the keys of what was taken."""
    shown = frames(places, noise_px, rng)
    return [key for frame in shown for key in collector.add(frame)]


def frames(places=PLACES, noise_px=0.0, rng=None):
    for tick in range(int(len(places) * STOP_S * 5)):
        stamp_s = BEGIN_S + 0.2 * tick
        labels = DATASET.collections[places[int(0.2 * tick / STOP_S)]].labels
        for name in DATASET.sensors:
            label = labels.get((name, PATTERN))
            frame = Frame(DATASET.sensors[name], stamp_s, header(stamp_s), image(name))
            if label is not None:
                noise = 0.0 if rng is None else noise_px * rng.standard_normal(label.pixels.shape)
                frame.set_label(PATTERN, Labeled(RgbLabel(label.ids, label.pixels + noise)))
            yield frame


def header(stamp_s):
    nsecs = int(round(1e9 * stamp_s))
    stamp = {"secs": nsecs // 10**9, "nsecs": nsecs % 10**9}
    return {"seq": 0, "stamp": stamp, "frame_id": "cam"}


def image(name):
    camera = DATASET.sensors[name].camera
    return np.zeros((camera.height, camera.width, 3), np.uint8)


def play_again(collector, *arguments, **options):
    collector.begin_anew(StopMoments(DATASET.patterns))
    return play(collector, *arguments, **options)


def test_stops_of_a_recording_that_is_played_again_are_not_taken_twice(collector):
    rng = np.random.default_rng(0)
    first = play(collector, noise_px=0.1, rng=rng)
    assert len(first) == len(PLACES) - 1  # the last one is not over yet
    for plays in (1, 2):  # other frames of the stops, as far as noise goes
        assert play_again(collector, noise_px=0.1, rng=rng) == []
        assert collector.again == plays * len(first)
    assert [text for text in left_out(collector, first) if "played again" in text]


def test_a_stop_whose_collection_was_deleted_is_taken_when_it_is_played_again(collector):
    first = play(collector)
    collector.delete(first[1])
    assert collector.deleted == 1
    assert len(play_again(collector)) == 1
    assert play_again(collector) == []


def test_another_place_at_the_same_time_is_another_stop(collector):
    first = play(collector)  # as in a simulation that is reset
    assert len(play_again(collector, PLACES[::-1])) == len(first)


@pytest.mark.parametrize("automatic", [True, False])
def test_the_stop_at_the_end_of_a_recording_is_taken_when_it_is_played_again(setup, automatic):
    live = LiveCollector(setup, None, Quiet(), automatic, ReceiptTimes([]))
    for _ in range(2):
        for frame in frames():
            if live._order.goes_back(frame):
                live._begin_anew()
            live._add(live._order.add(frame))
    assert live.count == automatic * len(PLACES)
