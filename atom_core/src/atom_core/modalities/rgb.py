"""RGB cameras: corners of the board in an image."""

from __future__ import annotations

from typing import Any

import numpy as np

from atom_core.evaluation.label_quality import quality_of_corners
from atom_core.evaluation.pairs import PairKind, rgb_rgb
from atom_core.geometry.rays import camera_rays
from atom_core.io.data_formats import COLOUR_IMAGES
from atom_core.io.label_json import CORNER_LABELS
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.modality import Modality
from atom_core.model.sensor import RGB
from atom_core.problem.corner_measurement import corner_blocks, measured_corners
from atom_core.synthetic import rgb as simulated
from atom_core.synthetic.rig import COLOUR_CAMERA, Mount, camera_mount, camera_of
from atom_core.synthetic.sensing import SyntheticSensor


def _mount(name: str, beam: str, beam_T_link: np.ndarray, model: Any) -> Mount:
    return camera_mount(name, RGB, beam, beam_T_link, model or COLOUR_CAMERA)


RGB_CAMERA = Modality(
    name=RGB,
    noun="rgb camera",
    message_types=("sensor_msgs/Image", "sensor_msgs/CompressedImage"),
    is_default_of=("sensor_msgs/Image", "sensor_msgs/CompressedImage"),
    has_camera_info=True,
    can_estimate_intrinsics=True,
    data=COLOUR_IMAGES,
    labels=CORNER_LABELS,
    labeler=RgbLabeler,
    measure=measured_corners,
    residual_blocks=corner_blocks,
    rays=lambda sensor: camera_rays(camera_of(sensor)),
    quality=quality_of_corners,
    pairs=(PairKind("rgb-rgb", RGB, RGB, "corner_transfer", "px", True, rgb_rgb),),
    synthetic=SyntheticSensor(_mount, simulated.observe, simulated.outlook, simulated.errors),
)
