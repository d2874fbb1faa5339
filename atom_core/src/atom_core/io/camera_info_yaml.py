"""Intrinsics in the YAML files of ROS's ``camera_calibration``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml.error import YAMLError

from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.io.paths import unread
from atom_core.io.structure import OTHER_KIND
from atom_core.io.yaml_text import load_yaml_1_2


def read_camera_info(path: Path) -> Camera:
    """Return the camera of a file with image_width, camera_matrix, distortion_coefficients ...

    Raises:
        DatasetError: the file is absent, or no such file.
    """
    try:
        document: Any = load_yaml_1_2(path.read_text(encoding="utf-8"))
        return Camera(
            width=int(document["image_width"]),
            height=int(document["image_height"]),
            K=np.array(document["camera_matrix"]["data"], dtype=float),
            D=np.array(document["distortion_coefficients"]["data"], dtype=float),
            model=str(document.get("distortion_model", "plumb_bob")),
        )
    except OSError as error:
        reason = unread(path, error)
        raise DatasetError(f"{path}: the intrinsics cannot be read ({reason})") from None
    except (YAMLError, *OTHER_KIND) as error:
        what = str(error).splitlines()[0] if str(error) else "it is empty"
        raise DatasetError(
            f"{path}: is no file of intrinsics as camera_calibration writes it ({what})"
        ) from None
