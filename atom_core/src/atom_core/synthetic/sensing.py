"""How sensors are simulated: what each modality says of itself to the synthetic scenes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterable, Mapping, NamedTuple, Optional, Sequence
from zlib import crc32

import numpy as np

from atom_core.model.labels import Label
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.synthetic.memory import MemoryDataSource, Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import BoardErrors, Planted, SensorErrors
from atom_core.synthetic.realism import PLAIN, Realism
from atom_core.synthetic.rig import Mount, Rig

DrawErrors = Callable[[Realism, Sensor, Any, np.random.Generator], SensorErrors]


@dataclass(frozen=True)
class View:
    """What one sensor of a rig has before it in one collection.

    Attributes:
        collection: its key.
        sensor: which looks, as it truly is.
        sensor_T_patterns: poses (4, 4) of the boards that are present, by pattern.
        world_T_sensor: pose (4, 4) of the sensor's data frame.
        rig: with the models of its sensors, and the room.
        patterns: all patterns as they truly are, by name.
        noise: of this sensor.
        errors: the systematic ones of this sensor, of its modality's kind, or none.
        rng: source of all randomness but that of the errors.
        errors_rng: source of theirs.
        sampling: density of clouds and labels.
        data: where the sensor puts what it measured.
        prepared: what sensors keep from one collection to the next, by name of the sensor.
    """

    collection: str
    sensor: Sensor
    sensor_T_patterns: Mapping[str, np.ndarray]
    world_T_sensor: np.ndarray
    rig: Rig
    patterns: Mapping[str, Pattern]
    noise: Noise
    errors: SensorErrors
    rng: np.random.Generator
    errors_rng: np.random.Generator
    sampling: Sampling
    data: MemoryDataSource
    prepared: Dict[str, Any]


class Outlook(NamedTuple):
    """What a sensor would make of a board.

    Attributes:
        seen: it would detect it.
        partial: a part of it only.
        rows: about how many residuals.
    """

    seen: bool
    partial: bool
    rows: float


@dataclass(frozen=True)
class SyntheticSensor:
    """How a modality is simulated.

    Attributes:
        mount: given name, beam, ``beam_T_base`` (4, 4) and a model of its optics or beams (None:
            the usual one), returns the sensor on that beam.
        observe: measures, keeps the data in ``View.data`` and returns the labels by pattern.
        outlook: given rig, sensor, ``sensor_T_pattern`` (4, 4) and pattern, tells what it sees.
        errors: given a realism, the sensor, its model and a source of randomness, draws its
            systematic errors; None where it has none.
    """

    mount: Callable[[str, str, np.ndarray, Any], Mount]
    observe: Callable[[View], Mapping[str, Label]]
    outlook: Callable[[Rig, Sensor, np.ndarray, Pattern], Outlook]
    errors: Optional[DrawErrors] = None


def simulation_of(sensor: Sensor) -> SyntheticSensor:
    """Return how a sensor is simulated.

    Raises:
        ValueError: its modality cannot be.
    """
    simulation = sensor.kind.synthetic
    if simulation is None:
        raise ValueError(f"sensor '{sensor.name}': modality {sensor.modality} is not simulated")
    return simulation


def planted_in(rig: Rig, patterns: Iterable[str], realism: Realism, seed: Sequence[int]) -> Planted:
    """Draw the systematic errors of a rig and its boards.

    What a sensor or a board draws depends on the seed and its name alone, so that an error
    planted alone is as large as together with others.

    Args:
        rig: the sensors, as the configuration has them.
        patterns: names of the boards.
        realism: sizes of the errors; `PLAIN` gives none.
        seed: integers.
    """
    if realism == PLAIN:
        return Planted()

    def rng_of(name: str) -> np.random.Generator:
        return np.random.default_rng([*seed, crc32(name.encode())])

    sensors = {}
    for name, sensor in rig.sensors.items():
        draw = simulation_of(sensor).errors
        if draw is not None and (realism.sensors is None or name in realism.sensors):
            sensors[name] = draw(realism, sensor, rig.lidars.get(name), rng_of(name))
    boards = {name: BoardErrors.drawn(realism, rng_of(name)) for name in patterns}
    return Planted(sensors, boards, realism.moving_edge_sigma_m, realism.moving_edge_sigma_rad)
