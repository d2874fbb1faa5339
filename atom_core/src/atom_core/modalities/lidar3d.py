"""3D LiDARs: points of the board in a cloud, and those on its border."""

from __future__ import annotations

import numpy as np

from atom_core.evaluation.common_part import nearest_points_in_common
from atom_core.evaluation.label_quality import quality_of_points
from atom_core.evaluation.pairs import (
    PairKind,
    border_in_depth_image,
    border_in_image,
    nearest_limit_points,
    nearest_points,
    points_to_plane,
)
from atom_core.evaluation.plane_pairs import to_plane_of_corners, to_plane_of_points
from atom_core.geometry.rays import spinning_rays
from atom_core.io.data_formats import CLOUDS
from atom_core.io.label_json import range_label_format
from atom_core.labeling.beam_width import estimate_beam_width
from atom_core.labeling.board_size import seen_boards
from atom_core.labeling.lidar3d import Lidar3dLabeler
from atom_core.model.modality import Modality, SeedFormat
from atom_core.model.range_points import cloud_points
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB
from atom_core.problem.range_measurement import measured_in_cloud, range_blocks
from atom_core.synthetic import lidar as simulated
from atom_core.synthetic.rig import lidar_mount
from atom_core.synthetic.sensing import SyntheticSensor

_CLOUDS = (
    "sensor_msgs/PointCloud2",
    "livox_ros_driver/CustomMsg",
    "livox_ros_driver2/CustomMsg",
)
_ELEVATIONS_DEG = (-10.0, 0.0, 10.0)
_AMONG_THEMSELVES = "lidar3d-lidar3d"
_PLANE, _COMMON = f"{_AMONG_THEMSELVES}_plane", f"{_AMONG_THEMSELVES}_common"
_FLOOR = (
    "from each point to the nearest one of the scan beside it. Scans have gaps, and this figure is "
    "mostly their width, and the part of the board that one of them does not see: it stays as "
    "large for a perfect calibration, and shows errors only where they are larger still. "
    f"{_PLANE} tells how well the scans lie on one another"
)
_COMMON_FLOOR = (
    "the same for the points in the outline of both labels alone. It does not count what only one "
    "of the two sees; the gaps between layers stay, some 0.3 of their width. It shows errors "
    f"across the board as {_PLANE} does, and hardly any along it"
)

_PAIRS = (
    PairKind("lidar3d-rgb", LIDAR3D, RGB, "border_reprojection", "px", False, border_in_image),
    PairKind("lidar3d-rgb_plane", LIDAR3D, RGB, "point_to_plane", "mm", False, to_plane_of_corners),
    PairKind(
        "lidar3d-depth", LIDAR3D, DEPTH, "border_reprojection", "px", False, border_in_depth_image
    ),
    PairKind(
        "lidar3d-depth_plane", LIDAR3D, DEPTH, "point_to_plane", "mm", False, to_plane_of_points
    ),
    PairKind(
        _AMONG_THEMSELVES, LIDAR3D, LIDAR3D, "nearest_point", "mm", False, nearest_points, _FLOOR
    ),
    PairKind(
        _COMMON,
        LIDAR3D,
        LIDAR3D,
        "nearest_point_in_common",
        "mm",
        False,
        nearest_points_in_common,
        _COMMON_FLOOR,
    ),
    PairKind(
        f"{_AMONG_THEMSELVES}_limit",
        LIDAR3D,
        LIDAR3D,
        "nearest_limit_point",
        "mm",
        True,
        nearest_limit_points,
        _FLOOR,
    ),
    PairKind(
        _PLANE,
        LIDAR3D,
        LIDAR3D,
        "point_to_plane",
        "mm",
        True,
        points_to_plane,
        by_planes=True,
    ),
)

LIDAR_3D = Modality(
    name=LIDAR3D,
    noun="lidar3d sensor",
    message_types=_CLOUDS,
    is_default_of=_CLOUDS,
    measures_range=True,
    can_estimate_range_offset=True,
    beam_width=estimate_beam_width,
    seen_boards=seen_boards,
    spins_about_z=True,
    data=CLOUDS,
    labels=range_label_format("idxs_limit_points"),
    seed=SeedFormat("xyz_m", 3, "m"),
    points=cloud_points,
    measured=lambda cloud: np.all(np.isfinite(cloud), axis=1),
    labeler=Lidar3dLabeler,
    measure=measured_in_cloud,
    residual_blocks=range_blocks,
    rays=lambda sensor: spinning_rays(_ELEVATIONS_DEG),
    quality=quality_of_points,
    pairs=_PAIRS,
    synthetic=SyntheticSensor(lidar_mount, simulated.observe, simulated.outlook, simulated.errors),
)
