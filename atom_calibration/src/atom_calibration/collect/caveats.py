"""What a recording puts in doubt without any label showing it: told once, kept with the dataset."""

from __future__ import annotations

from typing import Callable, Dict, List, Sequence, Set, Tuple

from atom_calibration.errors import TransformError
from atom_calibration.sources.contradictions import DoubtfulEdge
from atom_calibration.sources.rig import Rig, check_frames
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.model.caveats import Caveat
from atom_core.model.config import CalibrationConfig
from atom_core.model.transforms import Edge


class CaveatLog:
    """The caveats of a recording; those of its transforms come up while it is read."""

    def __init__(
        self,
        rig: Rig,
        config: CalibrationConfig,
        tree: TransformTree,
        doubtful: Callable[[], Sequence[DoubtfulEdge]],
        warn: Callable[[str], None],
        further: Callable[[], Sequence[Caveat]] = tuple,
    ):
        """Begin with what is known of the rig.

        Args:
            rig: the sensors, as the recording has them.
            config: the calibration.
            tree: transforms at the beginning.
            doubtful: returns the transforms that are in doubt by now.
            warn: is told each caveat, and each doubtful transform, once.
            further: returns what else has come into doubt by now.

        Raises:
            TransformError: the rig's frames do not hang together as the configuration says.
        """
        self._doubtful, self._further, self._warn = doubtful, further, warn
        self._told: Set[str] = set()
        try:
            self._first = (*rig.caveats, *check_frames(rig, config, tree))
        except TransformError:
            for doubt in doubtful():  # likely the cause
                self._tell(f"{doubt.what}; {doubt.remedy}")
            raise
        self._ways = _ways(rig, config, tree)

    def now(self) -> Tuple[Caveat, ...]:
        """Return all caveats by now; tell those that are new."""
        caveats = [*self._first, *self._further()]
        for doubt in self._doubtful():
            sensors = tuple(name for name, way in self._ways.items() if _is_on(doubt, way))
            if sensors:
                caveats.append(Caveat(sensors, doubt.what, doubt.remedy))
            else:
                self._tell(f"{doubt.what}; {doubt.remedy}")
        for caveat in caveats:
            self._tell(caveat.sentence)
        return tuple(caveats)

    def _tell(self, sentence: str) -> None:
        if sentence not in self._told:
            self._told.add(sentence)
            self._warn(sentence)


def _is_on(doubt: DoubtfulEdge, way: Sequence[Tuple[Edge, bool]]) -> bool:
    """Tell whether a transform in doubt is on a way, with a pose that nothing else estimates."""
    return any(
        edge.child == doubt.edge.child and not (estimated and doubt.only_its_pose)
        for edge, estimated in way
    )


def _ways(
    rig: Rig, config: CalibrationConfig, tree: TransformTree
) -> Dict[str, List[Tuple[Edge, bool]]]:
    """Return by sensor the edges that its answer hangs on, and whether each is estimated.

    These are the edges between the world and its data, and between the world and boards that stay
    where they are.
    """
    estimated = {edge for _, edge in config.estimated_edges}
    estimated |= {s.edge for name, s in rig.sensors.items() if name != config.anchored_sensor}
    to_boards = [
        edge
        for pattern in config.calibration_patterns.values()
        if pattern.fixed
        for edge in tree.path(config.world_link, pattern.parent_link)
    ]
    return {
        name: [
            (edge, edge in estimated)
            for edge in (*tree.path(config.world_link, sensor.frame), *to_boards)
        ]
        for name, sensor in rig.sensors.items()
    }
