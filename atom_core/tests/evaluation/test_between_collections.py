"""One collection against another by way of a board that stays: which are compared, and how."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation import between_collections as module
from atom_core.evaluation.between_collections import between_collections, spreads
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.pairs import Pair, pair_kinds
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise
from atom_core.synthetic.scenes import board_on_arm, hand_eye, random_scene, two_patterns

BOARD = "pattern_1"
POST = Edge("world", "post")
RGB_RGB = next(kind for kind in pair_kinds() if kind.name == "rgb-rgb")


@pytest.fixture(scope="module")
def exact():
    return hand_eye(0, collections=4, noise=Noise.none()).dataset


@pytest.fixture(scope="module")
def twin(exact):
    """The same rig with a second camera in the first one's place, which sees the same."""
    sensors = {**exact.sensors, "rgb_2": replace(exact.sensors["rgb_1"], name="rgb_2")}
    collections = {
        key: replace(c, labels={**c.labels, ("rgb_2", BOARD): c.labels["rgb_1", BOARD]})
        for key, c in exact.collections.items()
    }
    return replace(exact, sensors=sensors, collections=collections)


class Recorder:
    """A measure that remembers what it is asked; the errors are what is told."""

    def __init__(self, refused=(), unseen=0):
        self.asked, self.refused, self.unseen = {}, refused, unseen

    def __call__(self, observed, source, target, target_T_source):
        name = f"{source.collection}-{target.collection}"
        self.asked[name, source.pattern] = (source, target, target_T_source)
        if name in self.refused:
            raise NotMeasurableError(f"{name} is refused")
        return Errors(np.array([1.0]), unseen=self.unseen)


def recorded(dataset, source="rgb_1", target="rgb_1", *, recorder=None, true=None, **more):
    recorder = recorder or Recorder()
    pair = Pair(replace(RGB_RGB, measure=recorder), source, target)
    return recorder, between_collections(pair, Observed(dataset), dataset, true, **more)


def shifted(dataset, edge, shift_m):
    move = se3.transform(np.eye(3), np.array(shift_m))
    changes = {k: {edge: move @ c.transforms[edge]} for k, c in dataset.collections.items()}
    return dataset.with_transforms(changes)


def fixed(dataset, *names):
    patterns = {n: replace(p, fixed=n in names) for n, p in dataset.patterns.items()}
    return replace(dataset, patterns=patterns)


def names_of(keys):
    return [f"{a}-{b}" for a, b in combinations(keys, 2)]


# ---------------------------------------------------------------------------------- the figures


def test_a_sensor_with_itself_takes_each_two_collections_once(exact):
    recorder, result = recorded(exact)
    assert list(result.measured.per_collection) == names_of(exact.collections)
    for name, (source, target, _) in ((n, asked) for (n, _), asked in recorder.asked.items()):
        assert name == f"{source.collection}-{target.collection}"
        assert (source.sensor, target.sensor) == ("rgb_1", "rgb_1")


def test_two_sensors_take_every_collection_of_one_with_every_one_of_the_other(twin):
    fewer = twin.with_labels("003", {("rgb_2", BOARD): None})
    recorder, _ = recorded(fewer, "rgb_1", "rgb_2")
    expected = [f"{a}-{b}" for a in fewer.collections for b in ("000", "001", "002")]
    assert [name for name, _ in recorder.asked] == expected
    assert {(s.sensor, t.sensor) for s, t, _ in recorder.asked.values()} == {("rgb_1", "rgb_2")}


def test_the_source_is_carried_through_the_frame_in_which_the_board_stays(exact):
    recorder, _ = recorded(exact)
    frame = exact.sensors["rgb_1"].frame
    world_T_camera = {
        key: pose(c, exact.graph, "world", frame) for key, c in exact.collections.items()
    }
    for source, target, target_T_source in recorder.asked.values():
        np.testing.assert_allclose(
            world_T_camera[target.collection] @ target_T_source,
            world_T_camera[source.collection],
            atol=1e-12,
        )


def test_any_frame_that_stands_with_the_board_gives_the_same(exact):
    of_parent, _ = recorded(exact)
    of_base, _ = recorded(exact, frame="rig_base")
    for key, (_, _, target_T_source) in of_parent.asked.items():
        np.testing.assert_allclose(of_base.asked[key][2], target_T_source, atol=1e-12)


def test_in_a_frame_that_goes_with_the_camera_it_seems_to_stand_still(exact):
    recorder, _ = recorded(exact, frame="flange")
    for _, _, target_T_source in recorder.asked.values():
        np.testing.assert_allclose(target_T_source, np.eye(4), atol=1e-12)


def test_without_noise_the_true_calibration_puts_all_boards_in_one_place(exact):
    (found,) = spreads(exact, Observed(exact))
    assert found.measured.rms < 1e-3
    assert found.measured.translation_mm < 1e-3 and found.measured.rotation_deg < 1e-3
    assert found.at_truth is None and found.skipped is None


def test_a_camera_s_own_error_shows_as_the_spread_of_the_board(exact):
    """A shift d of the camera in its flange puts the board elsewhere by |(R_a - R_b) d|."""
    edge = exact.sensors["rgb_1"].edge
    shift_m = np.array([0.0, 0.03, -0.04])
    wrong = shifted(exact, edge, shift_m)
    (found,) = spreads(wrong, Observed(exact), true=exact)
    turn = {
        k: pose(c, exact.graph, "world", "flange")[:3, :3] for k, c in exact.collections.items()
    }
    for name, figures in found.measured.per_collection.items():
        a, b = name.split("-")
        expected_mm = 1000.0 * np.linalg.norm((turn[a] - turn[b]) @ shift_m)
        assert figures.translation_mm == pytest.approx(expected_mm, abs=0.01)
        assert figures.rotation_deg == pytest.approx(0.0, abs=1e-3)
    assert found.measured.rms > 1.0 > 1e-3 > found.at_truth.rms


def test_the_truth_is_measured_with_its_own_edges(exact):
    edge = exact.sensors["rgb_1"].edge
    true = shifted(exact, edge, [0.0, 0.05, 0.0])
    (found,) = spreads(exact, Observed(exact), true=true)
    (expected,) = spreads(true, Observed(exact))
    assert found.at_truth.per_collection == expected.measured.per_collection
    assert found.measured.rms < 1e-3


def test_points_that_are_not_seen_are_added_up_over_all_pairs(exact):
    _, result = recorded(exact, recorder=Recorder(unseen=2))
    assert result.unseen == 2 * len(names_of(exact.collections))


# --------------------------------------------------------------------------- what is skipped


def test_a_pair_that_cannot_be_measured_is_left_out_and_the_next_ones_are_measured(exact):
    recorder, result = recorded(exact, recorder=Recorder(refused=["000-002"]))
    every = names_of(exact.collections)
    assert len(recorder.asked) == len(every)
    assert list(result.measured.per_collection) == [n for n in every if n != "000-002"]
    assert result.skipped is None


def test_where_no_pair_can_be_measured_the_last_reason_is_told(exact):
    every = names_of(exact.collections)
    _, result = recorded(exact, recorder=Recorder(refused=every), true=exact)
    assert result.measured is None and result.at_truth is None
    assert result.skipped == f"{every[-1]} is refused"


def test_a_single_collection_is_compared_with_nothing(exact):
    recorder, result = recorded(exact.selected(collections=["001"]))
    assert not recorder.asked and result.measured is None
    assert result.skipped == "no two collections in which they see the same fixed board"


def test_a_board_that_one_of_them_never_sees_is_no_common_one(twin):
    for key in twin.collections:
        twin = twin.with_labels(key, {("rgb_2", BOARD): None})
    for names in (("rgb_1", "rgb_2"), ("rgb_2", "rgb_1"), ("rgb_2", "rgb_2")):
        _, result = recorded(twin, *names)
        assert result.skipped == "no two collections in which they see the same fixed board"


def test_boards_that_are_moved_by_hand_cannot_be_compared(exact):
    with pytest.raises(DatasetError, match="no pattern is fixed in its parent_link"):
        recorded(fixed(exact))


def test_a_frame_that_is_nowhere_is_refused(exact):
    with pytest.raises(DatasetError, match="frame 'nowhere' is in no transform; check -wf"):
        recorded(exact, frame="nowhere")


def test_of_two_patterns_only_those_that_are_fixed_and_asked_for_enter():
    dataset = two_patterns(0, collections=2, noise=Noise.none()).dataset
    for stays, asked, expected in (
        (["left", "right"], None, {"left", "right"}),
        (["right"], None, {"right"}),
        (["left", "right"], ["left"], {"left"}),
        (["right"], ["left", "right"], {"right"}),
    ):
        recorder, result = recorded(fixed(dataset, *stays), "rgb_2", "rgb_2", patterns=asked)
        assert {pattern for _, pattern in recorder.asked} == expected
        assert {row.pattern for row in result.measured.rows} == expected


# -------------------------------------------------------------------------- very many of them


@pytest.mark.parametrize("most, expected", [(6, 6), (7, 6), (5, 5), (2, 2), (1, 1)])
def test_no_more_pairs_of_collections_are_taken_than_the_most(exact, monkeypatch, most, expected):
    monkeypatch.setattr(module, "MOST_PAIRS", most)
    recorder, _ = recorded(exact)
    assert len(recorder.asked) == expected


def test_pairs_are_thinned_out_evenly_from_the_first_to_the_last(exact, monkeypatch):
    monkeypatch.setattr(module, "MOST_PAIRS", 3)
    recorder, _ = recorded(exact)
    every = names_of(exact.collections)
    assert [name for name, _ in recorder.asked] == [every[0], every[2], every[5]]


def test_of_the_3003_pairs_of_78_collections_3000_are_taken(exact):
    first = exact.collections["000"]
    many = {f"{i:03d}": replace(first, key=f"{i:03d}") for i in range(78)}
    recorder = Recorder(refused=names_of(many))
    recorded(replace(exact, collections=many), recorder=recorder)
    asked = [name for name, _ in recorder.asked]
    assert len(asked) == 3000
    assert (asked[0], asked[-1]) == ("000-001", "076-077")


# -------------------------------------------------------------------------- which have a spread


def test_a_board_on_the_arm_spreads_as_one_before_it():
    dataset = board_on_arm(0, collections=3, noise=Noise.none()).dataset
    (found,) = spreads(dataset, Observed(dataset))
    assert list(found.measured.per_collection) == names_of(dataset.collections)
    assert found.measured.rms < 1e-3


def test_a_spread_compares_a_camera_with_itself_in_pixels(exact):
    (found,) = spreads(exact, Observed(exact))
    assert (found.pair.source, found.pair.target) == ("rgb_1", "rgb_1")
    assert (found.pair.kind.name, found.pair.reverse) == ("rgb-rgb", False)


def test_where_neither_moves_any_calibration_gives_the_same(exact):
    still = {k: replace(exact.collections["000"], key=k) for k in exact.collections}
    (found,) = spreads(replace(exact, collections=still), Observed(exact))
    assert found.measured is None
    assert found.skipped == (
        "neither 'rgb_1' nor the board moves between the collections: any calibration gives the "
        "same"
    )


def test_a_camera_that_stands_still_does_not_keep_the_next_one_from_its_spread(exact):
    """The first camera stands in the world and sees the board as the other one does at first."""
    first = exact.collections["000"]
    standing = replace(exact.sensors["rgb_1"], name="still", frame="post", edge=POST)
    world_T_post = pose(first, exact.graph, "world", exact.sensors["rgb_1"].frame)
    collections = {
        key: replace(
            c,
            labels={**c.labels, ("still", BOARD): first.labels["rgb_1", BOARD]},
            transforms={**c.transforms, POST: world_T_post},
        )
        for key, c in exact.collections.items()
    }
    sensors = {"still": standing, **exact.sensors}
    dataset = replace(exact, sensors=sensors, collections=collections)
    found = spreads(dataset, Observed(dataset))
    assert [one.pair.source for one in found] == ["still", "rgb_1"]
    assert found[0].skipped and found[1].measured.rms < 1e-3


def test_sensors_that_are_no_cameras_and_boards_moved_by_hand_have_no_spread():
    dataset = random_scene(0, rgb=1, depth=1, lidar3d=0, collections=2, noise=Noise.none()).dataset
    assert spreads(dataset, Observed(dataset)) == []
    backwards = dict(reversed(list(fixed(dataset, BOARD).sensors.items())))
    dataset = replace(fixed(dataset, BOARD), sensors=backwards)
    assert [one.pair.source for one in spreads(dataset, Observed(dataset))] == ["rgb_1"]


def test_a_camera_that_sees_no_fixed_board_has_no_spread_but_the_next_one_does(twin):
    for key in twin.collections:
        twin = twin.with_labels(key, {("rgb_1", BOARD): None})
    (found,) = spreads(twin, Observed(twin))
    assert found.pair.source == "rgb_2" and found.measured.rms < 1e-3


def test_seeing_the_board_in_some_collections_is_enough(twin):
    fewer = twin.with_labels("000", {("rgb_1", BOARD): None})
    found = spreads(fewer, Observed(fewer))
    assert [len(one.measured.per_collection) for one in found] == [3, 6]


def test_only_boards_that_move_against_the_camera_enter_its_spread(exact):
    """A second board goes with the flange, as the camera does."""
    board = replace(exact.patterns[BOARD], name="carried", parent_frame="flange", frame="carried")
    collections = {
        key: replace(c, labels={**c.labels, ("rgb_1", "carried"): c.labels["rgb_1", BOARD]})
        for key, c in exact.collections.items()
    }
    patterns = {"carried": board, **exact.patterns}
    dataset = replace(exact, patterns=patterns, collections=collections)
    (found,) = spreads(dataset, Observed(dataset))
    assert {row.pattern for row in found.measured.rows} == {BOARD}
