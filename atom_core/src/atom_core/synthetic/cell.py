"""The collaborative cell of the paper: 3 RGB, 1 depth, 3 LiDAR, and its two sets of collections.

Rato et al., "A sensor-to-pattern calibration framework for multi-modal industrial collaborative
cells", J. Manufacturing Systems 64 (2022) 497-507: train set of 23 collections, 5 of them
complete, with 35 partial detections by the cameras; test set of 17, 4 and 26.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, is_complete
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import DEPTH, RGB
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco, held_before
from atom_core.synthetic.dataset import (
    Disturbance,
    SyntheticDataset,
    disturbed,
    disturbed_edges,
    make_dataset,
)
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.realism import PLAIN, Realism
from atom_core.synthetic.rig import (
    Rig,
    Room,
    assemble,
    camera_mount,
    jittered,
    lidar_mount,
    pinhole,
)
from atom_core.synthetic.sensing import planted_in, simulation_of

BIG, SMALL_1, SMALL_2 = (
    "bigbeam1_gantry",
    "smallbeam1_bigbeam1_gantry",
    "smallbeam2_bigbeam1_gantry",
)
_RECTANGULAR = "rectangularbeam{}_gantry"
_PLACED_M, _PLACED_RAD = 0.02, 0.02  # how far a real mount is from the drawing
_RIG, _DISTURBANCE, _NOISE, _ERRORS = 1, 2, 3, 4  # streams of random numbers of one seed
_CANDIDATES, _CANDIDATES_EACH = 240, 48  # poses to choose from; so many for each that is wanted
_KEPT = 8  # cells, some MB each


class Scenario(NamedTuple):
    """What a set of collections must look like (the paper's Table 1), and its residual rows."""

    stream: int
    collections: int
    complete: int
    partial: int
    rows: int

    def of_size(self, collections: int) -> Scenario:
        """Return a scenario with another number of collections and the same proportions."""
        share = collections / self.collections
        return Scenario(
            self.stream,
            collections,
            round(self.complete * share),
            round(self.partial * share),
            round(self.rows * share),
        )


SCENARIOS = {"train": Scenario(10, 23, 5, 35, 67000), "test": Scenario(20, 17, 4, 26, 49500)}
Accept = Callable[[np.ndarray, Sequence[str]], bool]


def cell_structure() -> Dict[Edge, np.ndarray]:
    """Return the gantry: world -> gantry -> leg -> beams."""

    def fixed(*xyz: float, rpy: Tuple[float, ...] = (0.0, 0.0, 0.0)) -> np.ndarray:
        return se3.from_rpy(np.array(xyz), np.array(rpy))

    edges = {
        Edge("world", "gantry"): fixed(0.0, 0.0, 0.0),
        Edge("gantry", "leg1_gantry"): fixed(-1.91, 1.31, 0.0),
        Edge("leg1_gantry", BIG): fixed(-0.5, 0.0, 2.29),
        Edge(BIG, SMALL_1): fixed(0.59, -3.2, 0.09),
        Edge(BIG, SMALL_2): fixed(4.39, -3.2, 0.09),
    }
    for number, x in enumerate((1.455, 2.455, 3.455), start=1):
        edges[Edge(BIG, _RECTANGULAR.format(number))] = fixed(x, -2.8, 0.0, rpy=(0, np.pi / 2, 0))
    return edges


def cell_rig(seed: int) -> Rig:
    """Return the true cell of a seed: the drawn mounts, each a little displaced."""
    rng = np.random.default_rng([seed, _RIG])

    def placed(*numbers: float) -> np.ndarray:
        drawn = se3.from_rpy(np.array(numbers[:3]), np.array(numbers[3:]))
        return jittered(drawn, _PLACED_M, _PLACED_RAD, rng)

    colour = pinhole(1280, 800, 1050.0, (-0.05, 0.01, 0.0005, -0.0005, 0.0))
    kinect = pinhole(640, 480, 320.0 / np.tan(np.radians(30.0)))
    sixth = np.pi / 6
    mounts = [
        camera_mount("rgb_1", RGB, SMALL_1, placed(0.09, 2.0, -0.09, 0, sixth, -sixth), colour),
        camera_mount(
            "rgb_2", RGB, SMALL_2, placed(-0.09, 2.0, -0.1, 0, sixth, sixth + np.pi), colour
        ),
        camera_mount(
            "rgb_3",
            RGB,
            BIG,
            placed(2.502082, -0.041751, -0.17, 0.001135, 0.526768, -1.568957),
            colour,
        ),
        camera_mount(
            "depth_1", DEPTH, BIG, placed(2.8, 0, -0.17, 0, sixth, -np.pi / 2), kinect, -0.02
        ),
        lidar_mount(
            "lidar_1",
            _RECTANGULAR.format(3),
            placed(0.077909, 1.440966, -0.008898, -0.477284, 1.171494, -0.005860),
        ),
        lidar_mount(
            "lidar_2",
            _RECTANGULAR.format(2),
            placed(0.071186, 2.307923, -0.150058, -1.672051, 0.025935, -1.144275),
        ),
        lidar_mount(
            "lidar_3",
            _RECTANGULAR.format(1),
            placed(0.146648, 1.513009, -0.063131, -1.972198, 0.32338, -1.298573),
        ),
    ]
    return assemble(
        "world",
        cell_structure(),
        mounts,
        anchored="rgb_3",
        room=Room((-4.0, -4.5, 0.0), (4.0, 3.5, 3.2)),
        centre=(0.0, -0.6, 1.0),
    )


def paper_cell(
    seed: int,
    scenario: str = "train",
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
    *,
    sampling: Sampling = Sampling(),  # noqa: B008 (frozen)
    realism: Realism = PLAIN,
) -> SyntheticDataset:
    """Simulate the paper's cell.

    Args:
        seed: the rig and the disturbance depend on it alone; board poses and noise on it and the
            scenario, so that a train and a test set of one seed share the rig.
        scenario: "train" (23 collections) or "test" (17).
        noise: how wrong the measurements are.
        disturbance: metres and radians by which each free edge of the dataset is wrong.
        sampling: density of clouds and labels.
        realism: systematic errors; what is drawn depends on the seed alone, as the rig does.

    Raises:
        ValueError: the scenario is unknown.
    """
    if scenario not in SCENARIOS:
        raise ValueError(f"scenario '{scenario}' is unknown; use {', '.join(SCENARIOS)}")
    exact = _exact_cell(seed, scenario, noise, sampling, realism)
    return disturbed(exact, disturbance, np.random.default_rng([seed, _DISTURBANCE]))


@lru_cache(maxsize=_KEPT)
def _exact_cell(
    seed: int, scenario: str, noise: Noise, sampling: Sampling, realism: Realism
) -> SyntheticDataset:
    """Return the cell without a disturbance; datasets are never changed, so the last are kept."""
    rig = cell_rig(seed)
    return make_dataset(
        rig,
        {"pattern_1": _poses_of(seed, scenario)},
        noise,
        np.random.default_rng([seed, SCENARIOS[scenario].stream, _NOISE]),
        sampling=sampling,
        name=f"paper_cell_{scenario}_{seed}",
        planted=planted_in(rig, ["pattern_1"], realism, [seed, _ERRORS]),
    )


@lru_cache(maxsize=256)
def _poses_of(seed: int, scenario: str) -> Tuple[np.ndarray, ...]:
    """Return the board poses (4, 4) of the paper's cell, which noise and errors leave alone."""
    wanted = SCENARIOS[scenario]
    rng = np.random.default_rng([seed, wanted.stream])
    poses = plan_board_poses(cell_rig(seed), wanted, rng)
    for pose in poses:
        pose.flags.writeable = False
    return tuple(poses)


def initial_edges(rig: Rig, seed: int, disturbance: Disturbance) -> Dict[Edge, np.ndarray]:
    """Return the calibrated edges as the disturbed cell of a seed has them (see ``paper_cell``)."""
    exact = {edge: rig.transforms[edge] for edge in rig.calibrated_edges}
    held = None if rig.anchored is None else rig.sensors[rig.anchored].edge
    moved = disturbed_edges(exact, held, disturbance, np.random.default_rng([seed, _DISTURBANCE]))
    return {**exact, **moved}


class Statistics(NamedTuple):
    """What a dataset holds; ``detections`` by sensor, ``rows`` = rows of its residual vector."""

    collections: int
    complete: int
    partial: int
    detections: Dict[str, int]
    rows: int


def statistics(dataset: Dataset) -> Statistics:
    """Count collections, complete ones, partial detections of cameras, and residual rows."""
    detections = dict.fromkeys(dataset.sensors, 0)
    partial = rows = 0
    for key, label in dataset.detections():
        detections[key.sensor] += 1
        partial += label.is_partial(dataset.patterns[key.pattern])
        rows += label.rows
    complete = sum(is_complete(dataset, key) for key in dataset.collections)
    return Statistics(len(dataset.collections), complete, partial, detections, rows)


class _Candidate(NamedTuple):
    """A board pose, which sensors (7,) detect it, how many cameras in part, about how many rows."""

    world_T_pattern: np.ndarray
    seen: np.ndarray
    partial: int
    rows: float


def plan_board_poses(
    rig: Rig, wanted: Scenario, rng: np.random.Generator, accept: Optional[Accept] = None
) -> List[np.ndarray]:
    """Draw board poses whose detections match a scenario, in random order.

    Args:
        rig: the sensors.
        wanted: numbers of collections, of complete ones and of partial detections.
        rng: source of all randomness.
        accept: told ``world_T_pattern`` and the sensors that detect the board; refuses poses,
            say because something stands in the way. All are accepted when None.

    Returns:
        ``world_T_pattern`` (4, 4) of each collection.

    Raises:
        ValueError: hardly any pose is accepted.
    """
    complete, others = _candidates(rig, wanted, rng, accept)
    # Partial views are rarer in a free draw than in the paper's hands: prefer them.
    weight = np.exp([0.8 * c.partial for c in others])
    best, lowest = [], np.inf
    for _ in range(500):
        chosen = [complete[i] for i in rng.choice(len(complete), wanted.complete, replace=False)]
        rest = wanted.collections - wanted.complete
        picked = rng.choice(len(others), rest, replace=False, p=weight / weight.sum())
        chosen += [others[i] for i in picked]
        badness = _badness(chosen, wanted)
        if badness < lowest:
            best, lowest = chosen, badness
        if badness == 0:
            break
    return [best[i].world_T_pattern for i in rng.permutation(len(best))]


def _candidates(
    rig: Rig, wanted: Scenario, rng: np.random.Generator, accept: Optional[Accept]
) -> Tuple[List[_Candidate], List[_Candidate]]:
    """Return poses that all sensors detect, and others that at least two detect."""
    enough = min(_CANDIDATES, _CANDIDATES_EACH * wanted.collections)
    pattern = pattern_from_config("pattern_1", charuco())
    sensor_T_world = {s: se3.inverse(rig.pose(x.frame)) for s, x in rig.sensors.items()}
    names = np.array(list(rig.sensors))
    complete: List[_Candidate] = []
    others: List[_Candidate] = []
    judged = 0
    for _ in range(100 * _CANDIDATES):
        candidate = _judge(rig, pattern, sensor_T_world, _draw_pose(pattern, rng))
        count = np.sum(candidate.seen)
        if accept is not None and (
            count < 2 or not accept(candidate.world_T_pattern, list(names[candidate.seen]))
        ):
            continue
        judged += 1
        if count >= 2:
            (complete if np.all(candidate.seen) else others).append(candidate)
        if (
            judged >= enough
            and len(complete) >= wanted.complete
            and len(others) >= wanted.collections - wanted.complete
        ):
            return complete, others
    raise ValueError("hardly any board pose is accepted; is the view of the sensors obstructed?")


def _badness(chosen: List[_Candidate], wanted: Scenario) -> float:
    """Return 0 when every sensor has four detections and all counts are as wanted."""
    least = min(4, wanted.collections)
    lacking = np.sum(np.maximum(least - np.sum([c.seen for c in chosen], axis=0), 0))
    partial = abs(sum(c.partial for c in chosen) - wanted.partial)
    rows = abs(sum(c.rows for c in chosen) / wanted.rows - 1.0)
    return 10.0 * lacking + partial + (0.0 if rows < 0.05 else 20.0 * rows)


def _draw_pose(pattern: Pattern, rng: np.random.Generator) -> np.ndarray:
    """Return ``world_T_pattern``: somewhere in the cell, facing its sensors roughly, any roll."""
    centre = rng.uniform((-1.3, -1.8, 0.5), (1.3, 0.4, 1.6))
    eye = np.array([rng.uniform(-1.5, 1.5), rng.uniform(-0.2, 1.3), 2.3])
    return held_before(eye, centre, pattern.border, rng)


def _judge(
    rig: Rig,
    pattern: Pattern,
    sensor_T_world: Mapping[str, np.ndarray],
    world_T_pattern: np.ndarray,
) -> _Candidate:
    """Find out which sensors would detect a board."""
    outlooks = [
        simulation_of(sensor).outlook(rig, sensor, sensor_T_world[name] @ world_T_pattern, pattern)
        for name, sensor in rig.sensors.items()
    ]
    return _Candidate(
        world_T_pattern,
        np.array([outlook.seen for outlook in outlooks]),
        sum(outlook.partial for outlook in outlooks),
        sum(outlook.rows for outlook in outlooks),
    )
