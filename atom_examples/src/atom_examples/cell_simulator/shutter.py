"""Pictures of a board in motion: a shutter is open for a while, and rows follow each other."""

from __future__ import annotations

from typing import Callable, Iterator, NamedTuple, Tuple

import numpy as np

_STEP_S = 0.0025  # between instants that are drawn; a board moves about half a pixel meanwhile


class Shutter(NamedTuple):
    """When the rows of a picture are exposed. Its stamp is the middle of all.

    Attributes:
        exposure_s: how long each row is.
        readout_s: from the first row to the last; 0: all at once.
    """

    exposure_s: float = 0.0
    readout_s: float = 0.0

    def instants(self, rows: int) -> Iterator[Tuple[float, np.ndarray]]:
        """Yield times [s] after the stamp, and the share (rows,) that each has of the rows' light.

        Args:
            rows: of the picture.
        """
        lasting_s = self.exposure_s + self.readout_s
        count = max(int(np.ceil(lasting_s / _STEP_S - 1e-9)), 1)
        step_s = lasting_s / count
        lit_s = max(self.exposure_s, step_s)  # no row for less than a step
        begin_s = self.readout_s * ((np.arange(rows) + 0.5) / rows - 0.5) - 0.5 * lit_s
        for number in range(count):
            first_s = -0.5 * lasting_s + number * step_s
            open_s = np.minimum(begin_s + lit_s, first_s + step_s) - np.maximum(begin_s, first_s)
            share = np.clip(open_s, 0.0, None) / lit_s if lit_s > 0 else np.ones(rows)
            if share.any():
                yield first_s + 0.5 * step_s, share

    def picture(self, draw: Callable[[float], np.ndarray], rows: int) -> np.ndarray:
        """Return the picture (rows, columns, channels) float32 of a scene in motion.

        Args:
            draw: returns the picture of an instant [s after the stamp].
            rows: of the picture.
        """
        total, light = None, np.zeros(rows, np.float32)
        for after_s, share in self.instants(rows):
            weight = share.astype(np.float32)
            part = draw(after_s).astype(np.float32) * weight[:, None, None]
            total = part if total is None else total + part
            light += weight
        assert total is not None
        return total / light[:, None, None]
