"""Intrinsics in the YAML files of ROS's ``camera_calibration``, and of OpenCV's programs.

OpenCV's have tags on matrices, and no name of the model: a fisheye is told by ``fisheye_model: 1``,
other models by how many coefficients there are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Mapping

import numpy as np
from ruamel.yaml.error import YAMLError

from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.io.paths import unread
from atom_core.io.structure import OTHER_KIND
from atom_core.io.yaml_text import load_yaml_1_2

_OF_OPENCV = "!!opencv-matrix"  # a map to us
_PLUMB_BOB_COEFFICIENTS = 5


def read_camera_info(path: Path) -> Camera:
    """Return the camera of a file with image_width, camera_matrix, distortion_coefficients ...

    Raises:
        DatasetError: the file is absent, or no such file.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        document: Any = load_yaml_1_2(text.replace(_OF_OPENCV, ""))
        if not isinstance(document, Mapping):
            raise ValueError("it is empty" if document is None else "it has no names of values")
        D = np.array(document["distortion_coefficients"]["data"], dtype=float).ravel()
        size = int(document["image_width"]), int(document["image_height"])
        K = np.array(document["camera_matrix"]["data"], dtype=float)
        model = str(document.get("distortion_model", _unnamed_model(document, D)))
    except OSError as error:
        reason = unread(path, error)
        raise DatasetError(f"{path}: the intrinsics cannot be read ({reason})") from None
    except (YAMLError, *OTHER_KIND) as error:
        what = (str(error).splitlines() or [type(error).__name__])[0]
        lacks = "it lacks " if isinstance(error, KeyError) else ""
        raise DatasetError(
            f"{path}: is no file of intrinsics as camera_calibration or OpenCV writes it "
            f"({lacks}{what})"
        ) from None
    try:
        return Camera(*size, K, D, model)
    except OTHER_KIND as error:
        raise DatasetError(f"{path}: these intrinsics cannot be used: {error}") from None


def _unnamed_model(document: Mapping[str, Any], D: np.ndarray) -> str:
    if int(document.get("fisheye_model", 0)):
        return "equidistant"
    return "rational_polynomial" if np.any(D[_PLUMB_BOB_COEFFICIENTS:]) else "plumb_bob"
