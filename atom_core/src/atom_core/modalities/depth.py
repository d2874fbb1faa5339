"""Depth cameras: pixels of the board in a depth image, and those on its border."""

from __future__ import annotations

from typing import Any

import numpy as np

from atom_core.evaluation.label_quality import quality_of_points
from atom_core.evaluation.pairs import PairKind, border_in_depth_image, border_in_image
from atom_core.evaluation.plane_pairs import to_plane_of_corners, to_plane_of_points
from atom_core.geometry.rays import camera_rays
from atom_core.io.data_formats import DEPTH_IMAGES
from atom_core.io.label_json import range_label_format
from atom_core.labeling.depth import DepthLabeler
from atom_core.model.modality import Modality, SeedFormat
from atom_core.model.range_points import depth_points
from atom_core.model.sensor import DEPTH, RGB
from atom_core.problem.range_measurement import measured_in_depth_image, range_blocks
from atom_core.synthetic import depth as simulated
from atom_core.synthetic.rig import DEPTH_CAMERA as USUAL_OPTICS
from atom_core.synthetic.rig import Mount, camera_mount, camera_of
from atom_core.synthetic.sensing import SyntheticSensor


def _mount(name: str, beam: str, beam_T_link: np.ndarray, model: Any) -> Mount:
    return camera_mount(name, DEPTH, beam, beam_T_link, model or USUAL_OPTICS)


DEPTH_CAMERA = Modality(
    name=DEPTH,
    noun="depth camera",
    message_types=("sensor_msgs/Image", "sensor_msgs/CompressedImage"),
    has_camera_info=True,
    measures_range=True,
    data=DEPTH_IMAGES,
    labels=range_label_format("idxs_limit_points"),
    seed=SeedFormat("uv_px", 2, "px"),
    points=depth_points,
    measured=lambda depth_m: np.isfinite(depth_m).ravel(),
    labeler=DepthLabeler,
    measure=measured_in_depth_image,
    residual_blocks=range_blocks,
    rays=lambda sensor: camera_rays(camera_of(sensor)),
    quality=quality_of_points,
    pairs=(
        PairKind("depth-rgb", DEPTH, RGB, "border_reprojection", "px", False, border_in_image),
        PairKind("depth-rgb_plane", DEPTH, RGB, "point_to_plane", "mm", False, to_plane_of_corners),
        PairKind(
            "depth-depth", DEPTH, DEPTH, "border_reprojection", "px", True, border_in_depth_image
        ),
        PairKind(
            "depth-depth_plane", DEPTH, DEPTH, "point_to_plane", "mm", True, to_plane_of_points
        ),
    ),
    synthetic=SyntheticSensor(_mount, simulated.observe, simulated.outlook, simulated.errors),
)
