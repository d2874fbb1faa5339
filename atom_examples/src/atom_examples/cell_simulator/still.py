"""What a sensor sees stays the same until something in the scene moves."""

from __future__ import annotations

from typing import Callable, Generic, Optional, Tuple, TypeVar

Seen = TypeVar("Seen")


class WhileStill(Generic[Seen]):
    """Keeps what was seen last, for as long as the scene stands as it stood then."""

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self._last: Optional[Tuple[object, Seen]] = None

    def seen(self, arrangement: object, see: Callable[[], Seen]) -> Seen:
        """Return what is seen; it is looked at anew only if the arrangement is another one.

        Args:
            arrangement: how the scene stands (``Scene.arrangement``); compared with the last one.
            see: looks at the scene. What it returns is shared: callers must not change it.
        """
        if self._last is None or self._last[0] != arrangement:
            self._last = (arrangement, see())
        return self._last[1]
