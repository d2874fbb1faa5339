"""What puts a sensor in doubt whatever its labels and residuals are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

from atom_core.errors import quoted


@dataclass(frozen=True)
class Caveat:
    """Something that was noticed and that no residual shows; what it concerns is at best weak.

    Attributes:
        sensors: names of the sensors that it concerns.
        what: what was noticed, without the sensors' names.
        remedy: what to do.
    """

    sensors: Tuple[str, ...]
    what: str
    remedy: str

    @property
    def sentence(self) -> str:
        """All of it, in one line."""
        plural = "s" * (len(self.sensors) > 1)
        return f"sensor{plural} {quoted(self.sensors)}: {self.what}; {self.remedy}"
