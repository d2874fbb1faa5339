"""Cameras in a dataset's JSON: their intrinsics, and whether the images are those of them."""

from __future__ import annotations

import re
from typing import Any, List, Mapping, Optional, Sequence

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.model.caveats import Caveat
from atom_core.model.sensor import Sensor

_RECTIFIED = re.compile(r"(^|[/_])rect(ified)?($|[/_])")  # as image_proc names its topics
_OTHER_SIZE, _ALIKE = 1.35, 0.15  # times of a size, and how far width and height may differ
Sensors = Mapping[str, Sensor]


def camera_of_entry(info: Mapping[str, Any]) -> Camera:
    """Return the camera of a `camera_info`.

    Raises:
        KeyError, ValueError, TypeError: something is absent or malformed; so do those below.
    """
    return Camera(
        width=int(info["width"]),
        height=int(info["height"]),
        K=np.array(info["K"], dtype=float),
        D=np.array(info["D"], dtype=float),
        model=info.get("distortion_model") or "plumb_bob",
    )


def looks_rectified(topic: str) -> bool:
    """Tell whether a topic is named as `image_proc` names those of rectified images."""
    return _RECTIFIED.search(topic) is not None


def lens_caveats(name: str, topic: str, camera: Camera, P: Sequence[float]) -> List[Caveat]:
    """Return what the intrinsics of a camera say against its images, if anything.

    Args:
        name: of the sensor.
        topic: of its images.
        camera: its intrinsics.
        P: the projection matrix (12, row by row) of the same CameraInfo; may be empty.
    """
    found = (_of_another_size(name, camera), _of_another_rectification(name, topic, camera, P))
    return [caveat for caveat in found if caveat is not None]


def _of_another_size(name: str, camera: Camera) -> Optional[Caveat]:
    """Return a caveat where the principal point would be in the middle of larger images, or less.

    A region of interest moves it, too, but hardly by the same part of width and height.
    """
    times_wide, times_high = 2.0 * camera.K[:2, 2] / (camera.width, camera.height)
    times = 0.5 * (times_wide + times_high)
    if 1.0 / _OTHER_SIZE < times < _OTHER_SIZE or abs(times_wide - times_high) > _ALIKE * times:
        return None
    return Caveat(
        (name,),
        f"its K puts the principal point at ({camera.K[0, 2]:.0f}, {camera.K[1, 2]:.0f}), the "
        f"middle of images about {times:.2g} times as wide and high as its {camera.width} x "
        f"{camera.height} pixels",
        "take the intrinsics of images of this size; where they were scaled, multiply the first "
        "two rows of K by the scale",
    )


def _of_another_rectification(
    name: str, topic: str, camera: Camera, P: Sequence[float]
) -> Optional[Caveat]:
    if not looks_rectified(topic):
        return None
    if np.any(camera.D):
        return Caveat(
            (name,),
            f"it has distortion coefficients, although its topic '{topic}' looks rectified",
            "one of the two is wrong: label the raw images, or set D to zeros, and K to the left "
            "three columns of P",
        )
    known = len(P) == 12 and P[0] > 0.0
    if known and not np.allclose(np.array(P).reshape(3, 4)[:, :3], camera.K, rtol=1e-6):
        return Caveat(
            (name,),
            f"it has another K than P, although its topic '{topic}' looks rectified",
            "rectified images are those of P: set K to its left three columns",
        )
    return None


def check_images(entries: Mapping[str, Any], data: Mapping[str, Any], sensors: Sensors) -> None:
    """Refuse a collection's images of another size than the intrinsics are for.

    Args:
        entries: of the sensors, by name.
        data: the collection's, by sensor.
        sensors: as read of the entries.

    Raises:
        ValueError: naming the sensor, both sizes, and what may have changed them.
    """
    for name, sensor in sensors.items():
        if sensor.camera is not None and data.get(name):
            _check_image_size(name, sensor.camera, entries[name]["camera_info"], data[name])


def _check_image_size(
    sensor: str, camera: Camera, info: Mapping[str, Any], image: Mapping[str, Any]
) -> None:
    size = tuple(image.get(key) for key in ("width", "height"))
    if None in size or size == (camera.width, camera.height):
        return
    region = info.get("roi") or {}
    binned = max(int(info.get(key) or 1) for key in ("binning_x", "binning_y")) > 1
    reason = "it has binning, " if binned else ""
    reason += "it has a region of interest, " if region.get("width") else ""
    raise ValueError(
        f"sensor '{sensor}': its image is {size[0]} x {size[1]} pixels, its camera_info says "
        f"{camera.width} x {camera.height}; they do not belong together: {reason}K, width and "
        f"height must be those of the images as they are"
    )


def with_camera(entry: Mapping[str, Any], camera: Optional[Camera]) -> Mapping[str, Any]:
    """Return a sensor's entry with other intrinsics, where they have changed."""
    info = entry.get("camera_info")
    if camera is None or not info:
        return entry
    before = camera_of_entry(info)
    same_model = before.model == camera.model
    if same_model and np.array_equal(before.K, camera.K) and np.array_equal(before.D, camera.D):
        return entry
    coefficients = [float(v) for v in camera.D]
    longer = [float(v) for v in info["D"][len(coefficients) :]]  # zeros of a longer layout
    changed = {**info, "K": [float(v) for v in camera.K.ravel()], "D": coefficients + longer}
    if not same_model:
        plain = camera.model == "none"  # written as plumb_bob with zeros, which every reader knows
        changed["distortion_model"] = "plumb_bob" if plain else camera.model
        changed["D"] = [0.0] * 5 if plain else coefficients
    P = np.array(info.get("P") or [], dtype=float)
    if P.size == 12 and np.allclose(P.reshape(3, 4)[:, :3], before.K):  # of the raw image
        P = P.reshape(3, 4)
        P[:, :3] = camera.K
        changed["P"] = [float(v) for v in P.ravel()]
    return {**entry, "camera_info": changed}
