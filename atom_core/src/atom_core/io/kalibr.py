"""Camera chains that Kalibr has calibrated: intrinsics, and where each camera is."""

from __future__ import annotations

from pathlib import Path
from typing import Any, List, Mapping, NamedTuple

import numpy as np
from ruamel.yaml.error import YAMLError

from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.io.paths import unread
from atom_core.io.structure import OTHER_KIND
from atom_core.io.yaml_text import load_yaml_1_2

_ROUNDED = 1e-3  # entries of a rotation that was written with few digits
_MODELS = {
    ("pinhole", "radtan"): "plumb_bob",
    ("pinhole", "equi"): "equidistant",
    ("pinhole", "equidistant"): "equidistant",
    ("pinhole", "none"): "none",
}


class ChainCamera(NamedTuple):
    """A camera of a chain.

    Attributes:
        name: cam0, cam1, ...
        camera: its intrinsics.
        topic: of its images; may be empty.
        first_T_camera: (4, 4), its place in the first camera's frame.
    """

    name: str
    camera: Camera
    topic: str
    first_T_camera: np.ndarray


def read_camchain(path: Path) -> List[ChainCamera]:
    """Read a chain of two cameras or more.

    Raises:
        DatasetError: the file is absent, no camchain, or of a camera model that is not known.
    """
    try:
        document: Any = load_yaml_1_2(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise DatasetError(f"{path}: the camchain cannot be read ({unread(path, error)})") from None
    except (YAMLError, ValueError) as error:
        raise DatasetError(f"{path}: is no YAML ({str(error).splitlines()[0]})") from None
    names = [f"cam{i}" for i in range(len(document or ()))]
    if isinstance(document, Mapping) and list(document) == ["cam0"]:
        raise DatasetError(
            f"{path}: holds one camera alone (cam0), which tells no pose of a camera in another "
            f"one; let Kalibr calibrate two or more together"
        )
    if not isinstance(document, Mapping) or len(names) < 2 or set(names) != set(document):
        raise DatasetError(f"{path}: is no camchain of Kalibr with cam0, cam1, ...")
    chain: List[ChainCamera] = []
    first_T_camera = np.eye(4)
    for name in names:
        entry = document[name]
        try:
            if chain:
                camera_T_before = _pose(entry["T_cn_cnm1"])
                first_T_camera = first_T_camera @ np.linalg.inv(camera_T_before)
            camera = _camera(entry)
        except OTHER_KIND as error:
            raise DatasetError(f"{path}: {name}: {_said(error)}") from None
        chain.append(ChainCamera(name, camera, str(entry.get("rostopic", "")), first_T_camera))
    return chain


def _said(error: Exception) -> str:
    return f"lacks {error}" if isinstance(error, KeyError) else str(error)


def _camera(entry: Mapping[str, Any]) -> Camera:
    kind = entry["camera_model"], entry["distortion_model"]
    if kind not in _MODELS:
        known = ", ".join("-".join(pair) for pair in _MODELS)
        raise ValueError(f"its model is {'-'.join(map(str, kind))}; known are {known}")
    fx, fy, cx, cy = (float(value) for value in entry["intrinsics"])
    D = [float(value) for value in entry["distortion_coeffs"]]
    model, (width, height) = _MODELS[kind], entry["resolution"]
    if model == "plumb_bob":
        D += [0.0] * (5 - len(D))
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Camera(int(width), int(height), K, np.array(D if model != "none" else []), model)


def _pose(rows: Any) -> np.ndarray:
    matrix = np.array(rows, dtype=float)
    if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
        raise ValueError("T_cn_cnm1 is no pose of 4 x 4 numbers")
    left, _, right = np.linalg.svd(matrix[:3, :3])
    nearest = left @ right
    if np.max(np.abs(nearest - matrix[:3, :3])) > _ROUNDED or np.linalg.det(nearest) < 0:
        raise ValueError("T_cn_cnm1 has no rotation")
    matrix[:3, :3], matrix[3] = nearest, [0.0, 0.0, 0.0, 1.0]
    return matrix
