"""seeds.yaml: where range sensors start to look for the board, given by hand or written down.

A list of ``{stamp: seconds or null for all, sensor: name, xyz_m: [x, y, z] in the cloud's frame |
uv_px: [u, v] in the depth image}``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Protocol, Sequence

import numpy as np
import yaml

from atom_core.errors import ConfigError
from atom_core.io.atomic import write_text_atomically
from atom_core.io.paths import unread
from atom_core.io.yaml_text import dump_yaml_1_1, load_yaml_1_1
from atom_core.model.modality import SeedFormat, modality_named
from atom_core.model.sensor import Sensor

SEEDS_FILE = "seeds.yaml"


@dataclass(frozen=True)
class Seed:
    """Where to look for the board in the data of one sensor.

    Attributes:
        sensor: its name.
        position: (3,) point [m] in a cloud, or (2,) pixel (u, v) of a depth image.
        stamp_s: time of the data; None for all.
    """

    sensor: str
    position: np.ndarray
    stamp_s: Optional[float] = None


class HasModality(Protocol):
    """A sensor, or its entry in a configuration."""

    @property
    def modality(self) -> Optional[str]:
        """Name of its modality; None: it is not known yet."""


def seed_format(sensor: HasModality) -> Optional[SeedFormat]:
    """Return how the seed of a sensor is written; None for one that needs none."""
    return None if sensor.modality is None else modality_named(sensor.modality).seed


def read_seeds(path: Path, sensors: Mapping[str, HasModality]) -> List[Seed]:
    """Read a file of seeds.

    Args:
        path: the YAML file.
        sensors: of the configuration, by name; also as the configuration has them.

    Raises:
        ConfigError: naming the file, the entry and the remedy.
    """
    try:
        entries = load_yaml_1_1(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        reason = unread(path, error)
        raise ConfigError(f"{path}: the seeds cannot be read ({reason}); check --seeds") from error
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{path}: this is not valid YAML: {error}") from error
    if entries is None:
        return []
    if not isinstance(entries, list):
        raise ConfigError(f"{path}: a list of seeds is expected; begin each entry with '- '")
    return [_seed(f"{path}: seed {i + 1}", entry, sensors) for i, entry in enumerate(entries)]


def write_seeds(path: Path, seeds: Sequence[Seed], sensors: Mapping[str, Sensor]) -> None:
    """Write seeds so that `read_seeds` reads the same, to the last digit: labels then repeat.

    Raises:
        OutputError: the file cannot be written.
    """
    entries: List[Dict[str, Any]] = []
    for seed in seeds:
        form = seed_format(sensors[seed.sensor])
        assert form is not None
        position = [float(v) for v in seed.position]
        entries.append({"stamp": seed.stamp_s, "sensor": seed.sensor, form.key: position})
    text = dump_yaml_1_1(entries, sort_keys=False, default_flow_style=None, width=100)
    write_text_atomically(path, text)


def _seed(where: str, entry: Any, sensors: Mapping[str, HasModality]) -> Seed:
    if not isinstance(entry, dict):
        raise ConfigError(f"{where} is no map; write stamp, sensor and xyz_m or uv_px")
    name = entry.get("sensor")
    formats = {known: seed_format(sensor) for known, sensor in sensors.items()}
    seeded = [known for known, form in formats.items() if form is not None]
    form = formats.get(str(name))
    if form is None:
        raise ConfigError(
            f"{where}: sensor '{name}' is no range sensor of the configuration; use one of "
            f"{', '.join(seeded) or 'none'}"
        )
    position, stamp = entry.get(form.key), entry.get("stamp")
    if not isinstance(position, list) or len(position) != form.size or not _finite(*position):
        raise ConfigError(f"{where} (sensor '{name}'): {form.key} has to be {form.size} numbers")
    if stamp is not None and not _finite(stamp):
        raise ConfigError(f"{where} (sensor '{name}'): stamp has to be seconds, or null for all")
    return Seed(str(name), np.array(position, dtype=float), None if stamp is None else float(stamp))


def _finite(*values: Any) -> bool:
    numbers = [v for v in values if isinstance(v, (int, float)) and not isinstance(v, bool)]
    return len(numbers) == len(values) and bool(np.all(np.isfinite(numbers)))
