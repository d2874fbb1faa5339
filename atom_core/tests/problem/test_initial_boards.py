"""Initial poses of boards: which candidate is taken, who judges, and which boards are doubtful."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import PATTERN, SENSOR, PoseBlock
from atom_core.problem.corner_measurement import M_PER_PX
from atom_core.problem.initial_boards import (
    GUESSED_M,
    SOLVED_M,
    Placement,
    _best_explaining,
    _total_misfit,
    better_boards,
    doubtful_boards,
    estimate_boards,
    misfit,
    misfits,
)
from atom_core.problem.measurements import Measurement
from atom_core.problem.parameters import Parameters
from atom_core.problem.problem import PoseChains, Problem
from atom_core.problem.residuals import OrthogonalBlock, ReprojectionBlock

RNG = np.random.default_rng(0)
TRUTH = se3.random_move(2.0, 1.0, RNG)  # parent_T_pattern
PARENT = se3.random_move(1.0, 0.5, RNG)  # world_T_parent


@dataclass(frozen=True)
class Seen(Measurement):
    """A board whose place the sensor measures, with candidates at some distances from it."""

    sensor_T_pattern: np.ndarray
    off_m: tuple = ()
    information: int = 1
    identifies_board: bool = True
    asked: list = field(default_factory=list)
    rows = 1

    def candidates(self):
        self.asked.append("candidates")
        return [beside(self.sensor_T_pattern, off_m) for off_m in self.off_m]

    def errors_m(self, sensor_T_pattern):
        self.asked.append("errors")
        return np.linalg.norm(
            sensor_T_pattern[..., :3, 3:] - self.sensor_T_pattern[:3, 3:], axis=-2
        )

    def implausibilities(self):
        return []


def beside(pose, off_m):
    moved = pose.copy()
    moved[2, 3] += off_m
    return moved


def world_T_sensor(name):
    return se3.random_move(2.0, 1.0, np.random.default_rng([ord(c) for c in name]))


def seen(sensor, *off_m, collection="000", off_truth_m=0.0, **fields):
    """Return a detection of the board, which the sensor believes so far from where it is."""
    pose = se3.inverse(world_T_sensor(sensor)) @ PARENT @ TRUTH
    key = DetectionKey(collection, sensor, "board")
    return Seen(key, beside(pose, off_truth_m), off_m, **fields)


def placed(measurements):
    keys = [m.key for m in measurements]
    return Placement(
        {(k.collection, k.sensor): world_T_sensor(k.sensor) for k in keys},
        {(k.collection, k.pattern): PARENT for k in keys},
    )


def estimated(*measurements, fixed=(), **known):
    return estimate_boards(measurements, fixed, placed(measurements), **known)


def off_m(pose):
    return float(np.linalg.norm((pose - TRUTH)[:3, 3]))


# --- how badly a pose explains -------------------------------------------------------------------


def test_misfit_is_none_for_no_error_half_for_an_usual_one_and_one_at_most():
    one = seen("a")
    for error_m, expected in ((0.0, 0.0), (0.2, 0.5), (0.6, 0.9), (1e9, 1.0)):
        found = misfit(one, beside(one.sensor_T_pattern, error_m), 0.2)
        assert found == pytest.approx(expected, abs=1e-12)


def test_misfit_is_the_mean_over_items():
    class Two(Seen):
        def errors_m(self, sensor_T_pattern):
            return np.array([0.0, -0.1])

    assert misfit(Two(*vars(seen("a")).values()), np.eye(4), 0.1) == pytest.approx(0.25)


def test_the_parent_is_seen_from_the_sensor_by_way_of_the_world():
    one = seen("a")
    found = placed([one]).sensor_T_parent(one)
    np.testing.assert_allclose(world_T_sensor("a") @ found, PARENT, atol=1e-12)


def test_misfits_of_several_sensors_add_up():
    far = [seen(name, off_truth_m=0.1) for name in "abc"]
    views = [(m, placed(far).sensor_T_parent(m)) for m in far]
    assert _total_misfit(views, TRUTH, 0.1) == pytest.approx(1.5)


def test_of_many_poses_each_has_its_own_misfit():
    one = seen("a")
    poses = np.array([beside(one.sensor_T_pattern, error_m) for error_m in (0.0, 0.2, 0.6)])
    np.testing.assert_allclose(misfits(one, poses, 0.2), [0.0, 0.5, 0.9], atol=1e-12)


def test_the_best_pose_is_the_one_of_the_least_sum_also_where_others_begin_better():
    several = [seen(name) for name in "abcd"]
    views = [(m, placed(several).sensor_T_parent(m)) for m in several]
    rng = np.random.default_rng(0)
    for _ in range(50):
        poses = [TRUTH @ se3.random_move(0.3, 0.1, rng) for _ in range(6)]
        every = [_total_misfit(views, pose, 0.1) for pose in poses]
        best, least = _best_explaining(views, poses, 0.1)
        assert best == np.argmin(every) and least == pytest.approx(min(every))


def test_the_best_pose_is_the_first_of_the_least_misfit():
    one = seen("a")
    views = [(one, placed([one]).sensor_T_parent(one))]
    poses = [TRUTH @ se3.from_rpy(np.array([d, 0, 0]), np.zeros(3)) for d in (0.3, 0.1, 0.1, 0.2)]
    best, least = _best_explaining(views, poses, 0.1)
    assert best == 1 and least == pytest.approx(0.5)
    assert _best_explaining(views, [], 0.1) == (0, np.inf)


# --- estimates -----------------------------------------------------------------------------------


def test_the_candidate_that_all_sensors_agree_on_is_taken():
    found = estimated(seen("a", 0.3, 0.0, -0.2), seen("b", 0.15))
    assert list(found) == [("board", "000")]
    np.testing.assert_allclose(found["board", "000"], TRUTH, atol=1e-9)


def test_a_fixed_pattern_has_one_pose_and_another_one_for_each_collection():
    several = [seen("a", 0.0, collection=c) for c in ("000", "001")]
    assert set(estimated(*several)) == {("board", "000"), ("board", "001")}
    assert set(estimated(*several, fixed=["board"])) == {("board", None)}


def test_a_board_that_no_sensor_can_place_has_no_estimate():
    assert estimated(seen("a"), seen("b")) == {}


def test_sensors_that_identify_the_board_propose_alone():
    vague = seen("b", 0.0, identifies_board=False)
    found = estimated(seen("a", 0.02), vague)
    assert off_m(found["board", "000"]) == pytest.approx(0.02)
    assert vague.asked.count("candidates") == 0
    found = estimated(seen("a"), seen("b", 0.0, identifies_board=False))  # if they can
    assert off_m(found["board", "000"]) == pytest.approx(0.0, abs=1e-9)


def test_the_eight_most_telling_sensors_propose():
    many = [seen(f"s{i:02}", 0.1, information=i) for i in range(11)]
    silent = [seen(f"t{i}", information=20 + i) for i in range(3)]  # tell no pose: do not count
    estimated(*many, *silent)
    asked = [m.asked.count("candidates") for m in many]
    assert asked == [0] * 3 + [1] * 8
    assert all(m.asked.count("candidates") == 1 for m in silent)


def test_the_twelve_most_telling_sensors_judge():
    many = [seen(f"s{i:02}", 0.1 if i == 14 else 0.0, information=i) for i in range(15)]
    estimated(*many)
    assert [bool(m.asked.count("errors")) for m in many] == [False] * 3 + [True] * 12


@pytest.mark.parametrize("mean_misfit, is_kept", [(0.049, True), (0.051, False)])
def test_a_known_pose_is_kept_while_it_is_good_enough(mean_misfit, is_kept):
    error_m = SOLVED_M * np.sqrt(mean_misfit / (1.0 - mean_misfit))
    several = [seen(name, error_m, off_truth_m=-error_m) for name in "ab"]
    known = {("board", "000"): TRUTH}
    found = estimated(*several, known=known)["board", "000"]
    assert (found is TRUTH) == is_kept
    assert is_kept == (several[0].asked.count("candidates") == 0)


def test_while_sensors_are_guesses_a_decimetre_is_nothing_unusual():
    """One sensor is 0.6 m off, two are nearly right: with 0.1 m the two outvote the one."""
    several = [seen("a", 0.0, 0.6), seen("b"), seen("c", off_truth_m=0.6)]
    votes = [misfit(several[0], beside(several[0].sensor_T_pattern, d), GUESSED_M) for d in (0, 1)]
    assert votes[0] < 0.5 < votes[1]
    assert off_m(estimated(*several)["board", "000"]) < 0.3
    assert (GUESSED_M, SOLVED_M) == (0.1, 0.05)


# --- second looks --------------------------------------------------------------------------------


def better(*measurements, now=TRUTH):
    return better_boards(measurements, (), placed(measurements), {("board", "000"): now})


def test_a_board_that_stands_wrong_takes_a_candidate_that_explains_far_better():
    found = better(seen("a", 0.0), now=beside(TRUTH, 0.3))
    np.testing.assert_allclose(found["board", "000"], TRUTH, atol=1e-9)


@pytest.mark.parametrize("share, is_taken", [(0.49, True), (0.51, False)])
def test_a_candidate_must_explain_twice_as_well(share, is_taken):
    now = 0.8
    now_m, candidate_m = (SOLVED_M * np.sqrt(m / (1.0 - m)) for m in (now, share * now))
    one = seen("a", candidate_m)
    assert bool(better(one, now=beside(TRUTH, now_m))) == is_taken


@pytest.mark.parametrize("mean_misfit, is_asked", [(0.049, False), (0.051, True)])
def test_a_board_that_stands_well_gets_no_second_look(mean_misfit, is_asked):
    now_m = SOLVED_M * np.sqrt(mean_misfit / (1.0 - mean_misfit))
    several = [seen(name, 0.0) for name in "ab"]
    assert bool(better(*several, now=beside(TRUTH, now_m))) == is_asked


def test_a_board_without_candidates_stays():
    assert better(seen("a"), now=beside(TRUTH, 0.3)) == {}


# --- doubtful boards -----------------------------------------------------------------------------

CAMERA = Camera(640, 480, np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), [], "none")


def judged(corners_px2, heights_m2, ids=None, boards=(1, 1)):
    """Return the doubtful blocks of a problem with a camera's and a LiDAR's detection.

    Args:
        corners_px2, heights_m2: squares of the rows of either.
        ids: of the LiDAR's points.
        boards: which block each detection's board is, -1 where it is held; 0 is the sensor's.
    """
    count = len(heights_m2)
    ids = np.arange(count) if ids is None else ids
    keys = [DetectionKey("000", "camera", "board"), DetectionKey("000", "lidar", "board")]
    none = np.zeros((count, 3))
    corners = np.zeros((len(corners_px2), 3))
    rows = (
        ReprojectionBlock(
            *("camera", "rgb", np.zeros(len(corners), dtype=int), np.ones(len(corners))),
            *(np.arange(len(corners)), CAMERA, corners, corners[:, :2]),
        ),
        OrthogonalBlock(
            *("lidar", "lidar3d", np.ones(count, dtype=int), np.ones(count), ids, none),
            *(np.zeros(count), np.zeros(count), None),
        ),
    )
    blocks = [PoseBlock(Edge("world", "lidar"), SENSOR, None, ("lidar",), np.eye(4))]
    for i in (1, 2):
        edge = Edge("world", f"board_{i}")
        blocks.append(PoseBlock(edge, PATTERN, f"00{i}", ("board",), np.eye(4)))
    chain = np.array([[0, boards[0]], [0, boards[1]]])
    chains = PoseChains(np.tile(np.eye(4), (2, 3, 1, 1)), chain, np.zeros((2, 2), dtype=bool))
    problem = Problem(Parameters(blocks), tuple(keys), chains, rows)
    return doubtful_boards(problem, [np.asarray(corners_px2), np.asarray(heights_m2)])


def square_of(mean_misfit, unit=1.0):
    return (SOLVED_M / unit) ** 2 * mean_misfit / (1.0 - mean_misfit)


@pytest.mark.parametrize("mean_misfit, is_doubtful", [(0.049, False), (0.051, True)])
def test_a_board_is_doubtful_where_its_detections_fit_badly(mean_misfit, is_doubtful):
    corners = np.full(8, square_of(mean_misfit, M_PER_PX))
    heights = np.full(5, square_of(mean_misfit))
    assert judged(corners, heights) == ([1] if is_doubtful else [])


def test_each_detection_counts_alike_whatever_its_number_of_rows():
    good, bad = np.zeros(50), np.full(2, square_of(0.12))
    assert judged(good, bad) == [1]  # (0 + 0.12) / 2
    assert judged(good, np.full(2, square_of(0.08))) == []


def test_boards_are_judged_apart():
    corners, heights = np.full(8, square_of(0.5, M_PER_PX)), np.zeros(5)
    assert judged(corners, heights, boards=(2, 1)) == [2]
    assert judged(corners, heights, boards=(1, 2)) == [1]
    assert judged(corners, np.full(5, 1.0), boards=(1, 2)) == [1, 2]


def test_a_board_that_is_held_is_not_doubtful():
    assert judged(np.full(8, 1e9), np.full(5, 1.0), boards=(-1, -1)) == []


def test_a_board_whose_rows_are_not_finite_is_doubtful():
    assert judged(np.full(8, np.nan), np.zeros(5)) == [1]


@pytest.mark.parametrize("count, of_all", [(399, 1), (400, 2), (600, 3)])
def test_some_two_hundred_points_of_a_detection_are_looked_at(count, of_all):
    ids = np.arange(count)
    on_some = np.where(ids % of_all == 0, 0.0, 1.0)
    assert judged(np.zeros(8), on_some, ids) == []
    looked_at = np.where(ids % of_all == 0, 1.0, 0.0)
    assert judged(np.zeros(8), looked_at, ids) == [1]
