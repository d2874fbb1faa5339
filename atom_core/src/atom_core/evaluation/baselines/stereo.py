"""OpenCV's stereo calibration of every pair of cameras, with the intrinsics as they are."""

from __future__ import annotations

from itertools import combinations
from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.evaluation.baselines.links import (
    Link,
    LinkedRig,
    linked_rig,
    move_against_each_other,
    seen_by_both,
    sensors_of,
)
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import Dataset
from atom_core.model.labels import RgbLabel
from atom_core.model.sensor import RGB

OPENCV = "opencv"
_FEWEST_CORNERS = 6  # of a view that both have; OpenCV fits each view's board by them at first
_FLAT = 1e-3  # second singular value of corners over the first: less is a line


class _Views(NamedTuple):
    """Corners that two cameras have in common, board by board."""

    corners: List[np.ndarray]  # (n, 3) in the board [m]
    source: List[np.ndarray]  # (n, 2) undistorted pixels
    target: List[np.ndarray]
    collections: int


def stereo_baseline(dataset: Dataset) -> LinkedRig:
    """Solve every pair of cameras by ``cv2.stereoCalibrate``.

    Boards that are seen in part count with the corners that both cameras see. Corners are
    undistorted beforehand with each camera's own model, so that lenses of any kind can take part.

    Args:
        dataset: with the labels.
    """
    links: List[Link] = []
    unsolved: Dict[Tuple[str, str], str] = {}
    for source, target in combinations(sensors_of(dataset, RGB), 2):
        if move_against_each_other(dataset, source, target):
            unsolved[source, target] = "they move against each other; OpenCV wants a stiff pair"
            continue
        views = _common_views(dataset, source, target)
        if not views.corners:
            unsolved[source, target] = (
                f"no image pair in which both see {_FEWEST_CORNERS} corners of a board in common"
            )
            continue
        try:
            found = _solved(dataset, source, target, views)
        except cv2.error as error:
            reason = str(error).strip() or "it does not say why"
            unsolved[source, target] = f"OpenCV gives up: {reason.splitlines()[-1]}"
            continue
        links.append(Link(source, target, found, views.collections))
    return linked_rig(OPENCV, dataset, links, unsolved)


def _common_views(dataset: Dataset, source: str, target: str) -> _Views:
    views, collections = _Views([], [], [], 0), set()
    for one, other in seen_by_both(dataset, source, target):
        there, here = dataset.label(one), dataset.label(other)
        assert isinstance(there, RgbLabel) and isinstance(here, RgbLabel)
        ids, of_source, of_target = np.intersect1d(there.ids, here.ids, return_indices=True)
        corners = dataset.patterns[one.pattern].corners_of(ids)
        if len(ids) < _FEWEST_CORNERS or _on_a_line(corners):
            continue
        views.corners.append(corners.astype(np.float32))
        views.source.append(_ideal(dataset, source, there.pixels[of_source]))
        views.target.append(_ideal(dataset, target, here.pixels[of_target]))
        collections.add(one.collection)
    return views._replace(collections=len(collections))


def _on_a_line(corners: np.ndarray) -> bool:
    sizes = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
    return bool(sizes[1] < _FLAT * sizes[0])


def _ideal(dataset: Dataset, name: str, pixels: np.ndarray) -> np.ndarray:
    """Return pixels (n, 2) as the camera would have them without distortion."""
    camera = _camera(dataset, name)
    straight = camera.normalise(pixels) * camera.focal_px + camera.centre_px
    return straight.astype(np.float32)


def _camera(dataset: Dataset, name: str) -> Camera:
    camera = dataset.sensors[name].camera
    assert camera is not None
    return camera


def _solved(dataset: Dataset, source: str, target: str, views: _Views) -> np.ndarray:
    one, other = _camera(dataset, source), _camera(dataset, target)
    found = cv2.stereoCalibrate(
        views.corners,
        views.source,
        views.target,
        one.K.copy(),
        np.zeros(5),
        other.K.copy(),
        np.zeros(5),
        (one.width, one.height),
        flags=cv2.CALIB_FIX_INTRINSIC,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-9),
    )
    return se3.transform(found[5], found[6].ravel())
