"""What the paper reports of its own simulated cell, table by table and pair by pair.

Rato et al., "A sensor-to-pattern calibration framework for multi-modal industrial collaborative
cells", J. Manufacturing Systems 64 (2022) 497-507, Tables 2 to 6, columns "Sim.".
"""

from __future__ import annotations

from typing import Dict, Mapping, NamedTuple, Optional, Tuple

from atom_core.evaluation.baselines.chain import KALIBR
from atom_core.evaluation.baselines.icp import METHODS as ICP_METHODS
from atom_core.evaluation.baselines.pairwise import PAIRWISE
from atom_core.evaluation.baselines.stereo import OPENCV

Names = Tuple[str, str]
FAILED = None  # the paper could not run it


class PaperTable(NamedTuple):
    """A table of the paper.

    Attributes:
        number: in the paper.
        title: of what.
        kind: of pairs, as in ``evaluation.json``.
        unit: px or mm.
        average: the paper's, over its pairs.
        goal: of ours.
        pairs: the paper's figure by (source, target).
        baselines: its figures of other methods, likewise; None where they failed.
    """

    number: int
    title: str
    kind: str
    unit: str
    average: float
    goal: float
    pairs: Mapping[Names, float]
    baselines: Mapping[str, Mapping[Names, Optional[float]]]


_LIDARS = (("lidar_1", "lidar_2"), ("lidar_1", "lidar_3"), ("lidar_2", "lidar_3"))
_CAMERAS = (("rgb_1", "rgb_2"), ("rgb_1", "rgb_3"), ("rgb_2", "rgb_3"))
_TO_DEPTH = tuple((f"lidar_{i}", "depth_1") for i in (1, 2, 3))
_FROM_DEPTH = tuple(("depth_1", f"rgb_{i}") for i in (1, 2, 3))
_TO_RGB = tuple((f"lidar_{i}", f"rgb_{k}") for k in (1, 2, 3) for i in (1, 2, 3))


def _icp(pairs: Tuple[Names, ...], *columns: Tuple[float, ...]) -> Dict[str, Dict[Names, float]]:
    """Return the paper's four columns of ICP; it has no fifth, of all collections at once."""
    return {name: dict(zip(pairs, column)) for name, column in zip(ICP_METHODS, columns)}


TABLES = (
    PaperTable(
        2,
        "RGB to RGB",
        "rgb-rgb",
        "px",
        0.563,
        0.5,
        dict(zip(_CAMERAS, (0.684, 0.463, 0.541))),
        {
            OPENCV: dict(zip(_CAMERAS, (FAILED, 0.675, 0.578))),
            KALIBR: dict(zip(_CAMERAS, (FAILED, 1.290, FAILED))),
        },
    ),
    PaperTable(
        3,
        "LiDAR to LiDAR, nearest points over the part of the board that both see",
        "lidar3d-lidar3d_common",
        "mm",
        32.974,
        32.97,
        dict(zip(_LIDARS, (26.472, 33.049, 39.401))),
        _icp(
            _LIDARS,
            (76.541, 248.526, 423.132),
            (28.088, 43.230, 38.212),
            (30.398, 33.033, 38.361),
            (127.468, 32.367, 115.198),
        ),
    ),
    PaperTable(
        4,
        "LiDAR to RGB",
        "lidar3d-rgb",
        "px",
        2.582,
        2.582,
        dict(zip(_TO_RGB, (1.726, 1.801, 2.692, 3.502, 3.659, 2.854, 2.892, 1.763, 2.352))),
        {},
    ),
    PaperTable(
        5,
        "LiDAR to depth",
        "lidar3d-depth",
        "px",
        1.306,
        1.306,
        dict(zip(_TO_DEPTH, (1.281, 1.054, 1.584))),
        _icp(
            _TO_DEPTH,
            (12.591, 16.478, 34.246),
            (1.575, 45.970, 5.951),
            (5.563, 2.477, 3.025),
            (2.094, 1.915, 3.493),
        ),
    ),
    PaperTable(
        6,
        "Depth to RGB",
        "depth-rgb",
        "px",
        3.394,
        3.394,
        dict(zip(_FROM_DEPTH, (3.328, 3.212, 3.642))),
        {},
    ),
)
# What the paper's figures do not say: the same pairs by metrics of our own, without a floor.
FURTHER_KINDS = {
    "lidar3d-lidar3d": "LiDAR to LiDAR, nearest points of whole labels, as in the paper",
    "lidar3d-lidar3d_plane": "LiDAR to LiDAR, points to the plane of the other label",
}
METHODS = (OPENCV, *ICP_METHODS, PAIRWISE)
