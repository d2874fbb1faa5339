"""Anderson acceleration: fewer rounds to a fixed point than by plain iteration."""

from __future__ import annotations

from typing import Optional

import numpy as np

_NEAR = 0.2  # changes beyond this say little about the next ones
# How much farther than a plain step it may go, and how much less far, in parts of the change.
_FARTHEST, _NEAREST = 4.0, 0.5


class AndersonAcceleration:
    """Looks for the fixed point of v -> v + change(v).

    Near the end the changes shrink (and turn) by the same part each time. Two of them tell that
    part, and so where they lead. The point that is found is the same. Anderson, "Iterative
    procedures for nonlinear integral equations" (1965), with a depth of one.
    """

    def __init__(self, start: np.ndarray):
        """Start from the vector (n,)."""
        self.value = start
        self._last_value: Optional[np.ndarray] = None
        self._last_change: Optional[np.ndarray] = None

    def advance(self, change: np.ndarray) -> np.ndarray:
        """Return the next vector (n,), given the change (n,) that the present one asks for."""
        reach = np.zeros_like(change)
        if self._last_change is not None and self._last_value is not None:
            turn = change - self._last_change
            square = float(turn @ turn)
            near = max(np.max(np.abs(change)), np.max(np.abs(self._last_change))) < _NEAR
            if near and square > 0.0:
                share = np.clip(float(turn @ change) / square, -_FARTHEST, _NEAREST)
                reach = -share * (self.value - self._last_value + turn)
        self._last_value, self._last_change = self.value, change
        self.value = self.value + change + reach
        return self.value
