"""``sensors.yaml``: what a robot description cannot say of its sensors."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.model.config import PatternConfig
from atom_core.model.config_border import SIDES
from atom_core.model.sensor import DEPTH, LIDAR2D, LIDAR3D, RGB
from atom_core.synthetic.lidar2d import Lidar2dModel
from atom_core.synthetic.lidar_models import AnyLidarModel, LidarModel, lidar_model
from atom_core.synthetic.realism import PLAIN, Realism
from atom_examples.cell_simulator.depth import DepthNoise
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.lidar import LidarNoise
from atom_examples.cell_simulator.profiles import PLAIN_PROFILE
from atom_examples.cell_simulator.yaml_entry import (
    Entry,
    count,
    not_negative,
    pair,
    positive,
    read_yaml,
    share,
)

ENCODINGS = ("16UC1", "32FC1")
_NO_PROFILES = {PLAIN_PROFILE: PLAIN}
_MIXED_WITHIN_BEAMS = 0.5  # of the edge, where a model of a LiDAR is asked for


@dataclass(frozen=True)
class SensorSettings:
    """What all sensors have: name, frame of the data, topic, rate when live."""

    name: str
    frame: str
    topic: str
    rate_hz: float


@dataclass(frozen=True)
class ColourSettings(SensorSettings):
    """A colour camera; ``noise_grey`` is the standard deviation of its grey levels."""

    info_topic: str
    camera: Camera
    noise_grey: float


@dataclass(frozen=True)
class DepthSettings(SensorSettings):
    """A depth camera."""

    info_topic: str
    camera: Camera
    range_m: Tuple[float, float]
    noise: DepthNoise


@dataclass(frozen=True)
class LidarSettings(SensorSettings):
    """A 3D LiDAR."""

    model: AnyLidarModel
    noise: LidarNoise


@dataclass(frozen=True)
class ScannerSettings(SensorSettings):
    """A 2D LiDAR."""

    model: Lidar2dModel
    noise: LidarNoise


AnySettings = Union[ColourSettings, DepthSettings, LidarSettings, ScannerSettings]


@dataclass(frozen=True)
class Settings:
    """All of the file.

    Attributes:
        sensors: the calibrated ones, by name, in order.
        others: further ones.
        board: the calibration pattern.
        profiles: sizes of the systematic errors by name; `PLAIN_PROFILE` has none.
    """

    sensors: Mapping[str, AnySettings]
    others: Mapping[str, AnySettings]
    board: PatternConfig
    profiles: Mapping[str, Realism]

    @property
    def all(self) -> List[AnySettings]:
        """All sensors."""
        return [*self.sensors.values(), *self.others.values()]


def read_settings(path: Path, scanners: bool = False, lidar: Optional[str] = None) -> Settings:
    """Read the file.

    Args:
        path: of the file.
        scanners: the 2D LiDARs are there.
        lidar: model of `LIDAR_MODELS` that all 3D LiDARs are; None: the one of the file.

    Raises:
        SimulatorError: it is absent or malformed; names the sensor and the key. Or there is no
            such model.
    """
    entry = read_yaml(path)
    document = entry.values
    sensors = _sensors(entry.part("sensors"))
    if lidar is not None:
        sensors = {name: _of_model(settings, lidar) for name, settings in sensors.items()}
    return Settings(
        sensors={**sensors, **_sensors(entry.part("scanners"))} if scanners else sensors,
        others=_sensors(entry.part("other_sensors")) if "other_sensors" in document else {},
        board=_pattern(entry.part("pattern")),
        profiles=_profiles(entry.part("realism")) if "realism" in document else _NO_PROFILES,
    )


def read_sensors(path: Path) -> Dict[str, AnySettings]:
    """Read the sensors alone, by name, in the order of the file.

    Raises:
        SimulatorError: it is absent or malformed; names the sensor and the key.
    """
    return _sensors(read_yaml(path).part("sensors"))


def _of_model(settings: AnySettings, name: str) -> AnySettings:
    """Return a 3D LiDAR as one of a model, with its noise and beams; others as they are."""
    if not isinstance(settings, LidarSettings):
        return settings
    try:
        model = lidar_model(name)
    except ValueError as error:
        raise SimulatorError(str(error)) from None
    mixed_within_rad = _MIXED_WITHIN_BEAMS * model.divergence_rad
    noise = LidarNoise(model.sigma_m, settings.noise.dropout, mixed_within_rad)
    return replace(settings, model=model, noise=noise)


def _sensors(entries: Entry) -> Dict[str, AnySettings]:
    readers: Mapping[str, Callable[[Entry, Dict[str, Any]], AnySettings]]
    readers = {RGB: _colour, DEPTH: _depth, LIDAR3D: _lidar, LIDAR2D: _scanner}
    sensors: Dict[str, AnySettings] = {}
    for name in entries.values:
        entry = entries.part(name)
        modality = entry.get("modality", str)
        if modality not in readers:
            raise SimulatorError(
                f"{entry.place}: modality '{modality}' is unknown; use {', '.join(readers)}"
            )
        common = {
            "name": str(name),
            "frame": entry.get("frame", str),
            "topic": entry.get("topic", str),
            "rate_hz": entry.get("rate_hz", positive),
        }
        sensors[name] = readers[modality](entry, common)
    return sensors


def _colour(entry: Entry, common: Dict[str, Any]) -> ColourSettings:
    return ColourSettings(
        **common,
        info_topic=entry.get("camera_info_topic", str),
        camera=_camera(entry),
        noise_grey=entry.part("noise").get("sigma_grey", not_negative),
    )


def _depth(entry: Entry, common: Dict[str, Any]) -> DepthSettings:
    noise = entry.part("noise")
    return DepthSettings(
        **common,
        info_topic=entry.get("camera_info_topic", str),
        camera=_camera(entry),
        range_m=entry.get("range_m", pair),
        noise=DepthNoise(
            sigma_m=noise.get("sigma_m", not_negative),
            sigma_per_square_m=noise.get("sigma_per_square_m", not_negative),
            sigma_from_m=noise.get("sigma_from_m", float),
            dropout=noise.get("dropout", share),
            bleeding_px=noise.get("bleeding_px", int),
        ),
    )


def _lidar(entry: Entry, common: Dict[str, Any]) -> LidarSettings:
    return LidarSettings(
        **common,
        model=LidarModel(
            rings=entry.get("rings", count),
            elevation_deg=entry.get("elevation_deg", pair),
            azimuth_steps=entry.get("azimuth_steps", count),
            range_m=entry.get("range_m", pair),
        ),
        noise=_lidar_noise(entry),
    )


def _scanner(entry: Entry, common: Dict[str, Any]) -> ScannerSettings:
    beams = entry.get("beams", count)
    model = Lidar2dModel(
        angle_increment=2.0 * np.pi / beams, beams=beams, range_m=entry.get("range_m", pair)
    )
    return ScannerSettings(**common, model=model, noise=_lidar_noise(entry))


def _lidar_noise(entry: Entry) -> LidarNoise:
    noise = entry.part("noise")
    return LidarNoise(
        sigma_m=noise.get("sigma_m", not_negative),
        dropout=noise.get("dropout", share),
        mixed_within_rad=entry.get("beam_divergence_rad", not_negative)
        * noise.get("mixed_within_beams", not_negative),
    )


def _camera(entry: Entry) -> Camera:
    try:
        return Camera(
            width=entry.get("width", count),
            height=entry.get("height", count),
            K=entry.get("K", np.array),
            D=entry.get("D", np.array),
            model=entry.get("distortion_model", str),
        )
    except ValueError as error:
        raise SimulatorError(f"{entry.place}: {error}") from None


def _pattern(entry: Entry) -> PatternConfig:
    columns, rows = entry.get("corners", pair)
    return PatternConfig(
        link=entry.get("frame", str),
        parent_link=entry.get("parent_frame", str),
        fixed=False,
        pattern_type=entry.get("type", str),
        dimension=(int(columns), int(rows)),
        size=entry.get("square_m", positive),
        **entry.get("border_m", _border),
        inner_size=entry.get("marker_m", positive),
        dictionary=entry.get("dictionary", str),
    )


def _border(value: Any) -> Dict[str, Any]:
    """Return the border as a configuration has it: [x, y], or a width for each side."""
    if not isinstance(value, Mapping):
        return {"border_size": pair(value)}
    if set(value) != set(SIDES):
        raise ValueError(f"it has {', '.join(map(str, value))}, not {', '.join(SIDES)}")
    return {"border": tuple(not_negative(value[side]) for side in SIDES)}


def _profiles(entries: Entry) -> Dict[str, Realism]:
    profiles = dict(_NO_PROFILES)
    known = {field.name for field in fields(Realism)}
    for name in entries.values:
        entry = entries.part(name)
        for key in entry.values:
            if key not in known:
                raise SimulatorError(f"{entry.place}: '{key}' is unknown; remove or mend it")
        try:
            profiles[str(name)] = Realism(**{key: entry.get(key, _size) for key in entry.values})
        except ValueError as error:
            raise SimulatorError(f"{entry.place}: {error}; mend it") from None
    return profiles


def _size(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_size(v) for v in value)
    if isinstance(value, (bool, str)) or not np.isfinite(value):
        raise ValueError(f"{value} is no number")
    return value
