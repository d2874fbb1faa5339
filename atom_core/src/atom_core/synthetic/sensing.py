"""How sensors are simulated: what each modality says of itself to the synthetic scenes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Dict, Mapping, NamedTuple

import numpy as np

from atom_core.model.labels import Label
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.synthetic.memory import MemoryDataSource, Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Mount, Rig


@dataclass(frozen=True)
class View:
    """What one sensor of a rig has before it in one collection.

    Attributes:
        collection: its key.
        sensor: which looks.
        sensor_T_patterns: poses (4, 4) of the boards that are present, by pattern.
        world_T_sensor: pose (4, 4) of the sensor's data frame.
        rig: with the models of its sensors, and the room.
        patterns: all patterns, by name.
        noise: of this sensor.
        rng: source of all randomness.
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
    rng: np.random.Generator
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
    """

    mount: Callable[[str, str, np.ndarray, Any], Mount]
    observe: Callable[[View], Mapping[str, Label]]
    outlook: Callable[[Rig, Sensor, np.ndarray, Pattern], Outlook]


def simulation_of(sensor: Sensor) -> SyntheticSensor:
    """Return how a sensor is simulated.

    Raises:
        ValueError: its modality cannot be.
    """
    simulation = sensor.kind.synthetic
    if simulation is None:
        raise ValueError(f"sensor '{sensor.name}': modality {sensor.modality} is not simulated")
    return simulation
