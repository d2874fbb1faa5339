"""Data of a synthetic dataset, held in memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Mapping, Sequence, Tuple

import numpy as np

from atom_core.model.config import PatternConfig
from atom_core.model.dataset import DataSource
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.synthetic.board_image import render


@dataclass(frozen=True)
class Sampling:
    """How densely range data are kept.

    Attributes:
        background_step: of the returns from the room every n-th stays in a cloud; 1 keeps all.
        depth_step: grid of the labeled depth pixels [px].
        exact_border: move LiDAR limit points onto the true border, and label no depth limit
            pixels (they lie up to a pixel inside), so that border residuals vanish too.
        labeled_only: keep only what is labeled of a depth image, for large datasets.
    """

    background_step: int = 16
    depth_step: int = 4
    exact_border: bool = False
    labeled_only: bool = False


class MemoryDataSource(DataSource):
    """Clouds and depth images held in memory; pictures are rendered when asked for."""

    def __init__(self, patterns: Mapping[str, Tuple[Pattern, PatternConfig]]):
        """Start empty.

        Args:
            patterns: each pattern with its part of the configuration (for its texture).
        """
        self._patterns = patterns
        self._arrays: Dict[Tuple[str, str], Any] = {}
        self._pixels: Dict[Tuple[str, str], Tuple[Tuple[int, ...], np.ndarray, np.ndarray]] = {}
        self._views: Dict[Tuple[str, str], Tuple[Sensor, Mapping[str, np.ndarray]]] = {}

    def add(self, collection: str, sensor: str, data: Any) -> None:
        """Keep a cloud, a scan or a depth image."""
        self._arrays[(collection, sensor)] = data

    def add_pixels(
        self, collection: str, sensor: str, image: np.ndarray, indices: np.ndarray
    ) -> None:
        """Keep some pixels (n,) of a depth image; the others will be NaN."""
        self._pixels[(collection, sensor)] = (image.shape, indices, image.ravel()[indices])

    def add_view(
        self, collection: str, sensor: Sensor, camera_T_patterns: Mapping[str, np.ndarray]
    ) -> None:
        """Keep what a camera looks at, to render it later."""
        self._views[(collection, sensor.name)] = (sensor, camera_T_patterns)

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether there are data of a sensor in a collection."""
        kept: Sequence[Mapping[Tuple[str, str], object]]
        kept = (self._arrays, self._pixels, self._views)
        return any((collection, sensor) in those for those in kept)

    def read(self, collection: str, sensor: str) -> Any:
        """Return a cloud, a scan, a depth image, or a picture of the boards before grey."""
        place = (collection, sensor)
        if place in self._pixels:
            shape, indices, depths = self._pixels[place]
            image = np.full(shape, np.nan)
            image.ravel()[indices] = depths
            return image
        if place in self._views:
            viewer, camera_T_patterns = self._views[place]
            assert viewer.camera is not None
            boards = [(self._patterns[n], pose) for n, pose in camera_T_patterns.items()]
            return render(viewer.camera, boards)
        return self._arrays[place] if place in self._arrays else super().read(*place)
