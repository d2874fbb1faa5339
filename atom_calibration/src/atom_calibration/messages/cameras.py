"""Intrinsics: CameraInfo to the core's camera and back."""

from __future__ import annotations

from typing import Any

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
