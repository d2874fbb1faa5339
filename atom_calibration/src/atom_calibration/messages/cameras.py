"""Intrinsics: CameraInfo to the core's camera and back."""

from __future__ import annotations

from typing import Any, Optional, Tuple

import numpy as np
from sensor_msgs.msg import CameraInfo

from atom_calibration.errors import MessageError
from atom_core.geometry.camera import Camera

CAMERA_INFO = "sensor_msgs/CameraInfo"


def camera_from_info(message: Any) -> Camera:
    """Return the intrinsics of a CameraInfo.

    Raises:
        MessageError: the camera is not calibrated, or its numbers do not fit its model.
    """
    if not message.K[0] or not message.width or not message.height:
        raise MessageError(
            f"the camera is not calibrated (fx = {message.K[0]}, {message.width} x "
            f"{message.height} pixels); calibrate its intrinsics first"
        )
    try:
        return Camera(
            width=int(message.width),
            height=int(message.height),
            K=np.array(message.K, dtype=float),
            D=np.array(message.D, dtype=float),
            model=message.distortion_model or "plumb_bob",
        )
    except ValueError as error:
        raise MessageError(f"camera_info: {error}") from None


def is_cut_or_binned(message: Any) -> bool:
    """Tell whether a CameraInfo says that images are a region of the full resolution, or binned."""
    return max(message.binning_x, message.binning_y) > 1 or bool(message.roi.width)


def camera_of_images(message: Any, image_size: Optional[Tuple[int, int]]) -> Camera:
    """Return the intrinsics of images that a driver cuts to a region, or bins.

    A CameraInfo tells those of the full resolution, the region in its pixels, and how many of them
    make a pixel of the image (sensor_msgs/CameraInfo). Drivers differ: some tell those of the
    images already. Hence this is done only where it explains their size, and nothing else does.

    Args:
        message: the CameraInfo.
        image_size: width and height of the images [px]; None: not known.

    Raises:
        MessageError: as of `camera_from_info`.
    """
    camera = camera_from_info(message)
    if image_size in (None, (camera.width, camera.height)):
        return camera
    region, binning = message.roi, (max(message.binning_x, 1), max(message.binning_y, 1))
    width, height = region.width or camera.width, region.height or camera.height
    if (width // binning[0], height // binning[1]) != image_size:
        return camera
    return camera.part((region.x_offset, region.y_offset), binning, image_size)


def camera_info_message(camera: Camera) -> CameraInfo:
    """Return intrinsics as a CameraInfo; the header is left to the caller.

    A camera without distortion is plumb_bob with zeros, which every reader knows.
    """
    return CameraInfo(
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob" if camera.model == "none" else camera.model,
        D=[float(v) for v in camera.D] or [0.0] * 5,
        K=[float(v) for v in camera.K.ravel()],
        R=[float(v) for v in np.eye(3).ravel()],
        P=[float(v) for v in np.column_stack([camera.K, np.zeros(3)]).ravel()],
    )
