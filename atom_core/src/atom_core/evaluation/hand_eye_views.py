"""A camera and a board of which one is carried by an arm: what each collection says of both.

In every collection ``F = G_i X H_i``. G is the pose of the camera's side in the board's side, which
the robot reports; X the camera in its side and F the board in its side, which are constant; H the
board in the camera, by its corners alone. It makes no difference whether camera or board moves.

Where a joint moves the camera below its calibrated edge, as in a head that tilts, the camera in its
side is not constant. Then X is the child of the edge in the camera's side, and H the board in it.
"""

from __future__ import annotations

from collections import Counter
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.sensor import RGB

_LEAST = 3  # collections
_TURNED_RAD = np.radians(1.0)  # less, about a second axis, is no turning
_MOVED_M, _MOVED_RAD = 1e-4, 1e-4  # less is standing still
_CONSTANT = 1e-9


class Sides(NamedTuple):
    """Which frames stand for G: one that is fixed to the camera, one that is to the board."""

    of_camera: str
    of_board: str


class HandEyeViews(NamedTuple):
    """What a camera and a board give for a hand-eye calibration.

    Attributes:
        sides: the frames between which G is.
        frame: whose pose X is: the camera's data frame, or the child of its edge where the two
            move against each other.
        collections: in which the board's pose is told by the camera's corners.
        G: ``board_side_T_camera_side`` (4, 4) of each.
        H: ``frame_T_board`` (4, 4) of each.
    """

    sides: Sides
    frame: str
    collections: List[str]
    G: List[np.ndarray]
    H: List[np.ndarray]


def usual_sides(dataset: Dataset, camera: str, pattern: str) -> Sides:
    """Return the parents of the camera's edge and of the board."""
    return Sides(
        dataset.sensors[camera].edge.parent,
        dataset.patterns[pattern].parent_frame,
    )


def board_of(dataset: Dataset, camera: str) -> str:
    """Return the fixed board that a camera sees in most collections.

    Raises:
        DatasetError: it sees none.
    """
    counts = Counter(
        key.pattern
        for key, _ in dataset.detections()
        if key.sensor == camera and dataset.patterns[key.pattern].fixed
    )
    if not counts:
        raise DatasetError(
            f"{dataset.source}: camera '{camera}' sees no board that is fixed in its parent_link; "
            f"set `fixed: true` of the pattern in the configuration if it is"
        )
    return max(counts, key=lambda name: counts[name])


def hand_eye_views(
    dataset: Dataset,
    camera: str,
    pattern: str,
    sides: Optional[Sides] = None,
    observed: Optional[Observed] = None,
) -> HandEyeViews:
    """Return what the collections say of a camera and a board.

    Args:
        dataset: with labels and transforms.
        camera: an rgb camera.
        pattern: a board that is fixed in its parent.
        sides: frames that stand for camera and board; None: the parents of their edges.
        observed: its labels, if they are at hand.

    Raises:
        DatasetError: they are no such pair, or the collections do not tell X; the message says
            why.
    """
    _check_pair(dataset, camera, pattern)
    sides = sides or usual_sides(dataset, camera, pattern)
    observed = observed or Observed(dataset)
    views: Dict[str, np.ndarray] = {}
    for key, collection in dataset.collections.items():
        label = collection.labels.get((camera, pattern))
        if label is not None and label.detected:
            try:
                views[key] = observed.camera_T_pattern(DetectionKey(key, camera, pattern))
            except NotMeasurableError:
                continue
    where = f"{dataset.source}: camera '{camera}' and board '{pattern}'"
    if len(views) < _LEAST:
        raise DatasetError(
            f"{where}: the board's pose is told in {len(views)} collections, a hand-eye "
            f"calibration takes {_LEAST} at least; collect more"
        )
    keys = list(views)
    _check_rigid(dataset, keys, sides.of_camera, dataset.sensors[camera].edge.parent)
    _check_rigid(dataset, keys, sides.of_board, dataset.patterns[pattern].parent_frame)
    frame, frame_T_camera = _rigid_frame(dataset, camera, keys)
    H = [before @ views[key] for key, before in zip(keys, frame_T_camera)]
    found = with_transforms_of(dataset, HandEyeViews(sides, frame, keys, [], H))
    why = undetermined(found.G)
    if why:
        raise DatasetError(f"{where}: {why}")
    return found


def with_transforms_of(dataset: Dataset, views: HandEyeViews) -> HandEyeViews:
    """Return views of which G is by a dataset's transforms."""
    graph, (of_camera, of_board) = dataset.graph, views.sides
    collections = [dataset.collections[key] for key in views.collections]
    return views._replace(G=[pose(c, graph, of_board, of_camera) for c in collections])


def _rigid_frame(
    dataset: Dataset, camera: str, keys: Sequence[str]
) -> Tuple[str, List[np.ndarray]]:
    """Return the frame whose pose is constant, and ``frame_T_camera`` (4, 4) of collections."""
    sensor, graph = dataset.sensors[camera], dataset.graph
    child = sensor.edge.child
    poses = [pose(dataset.collections[key], graph, child, sensor.frame) for key in keys]
    if _constant(poses):
        return sensor.frame, [np.eye(4)] * len(poses)
    return child, poses


def _check_pair(dataset: Dataset, camera: str, pattern: str) -> None:
    if camera not in dataset.sensors or dataset.sensors[camera].modality != RGB:
        cameras = [s.name for s in dataset.sensors.values() if s.modality == RGB]
        raise DatasetError(
            f"{dataset.source}: there is no rgb camera '{camera}'; there are: "
            f"{', '.join(cameras) or 'none'}"
        )
    if pattern not in dataset.patterns:
        raise DatasetError(
            f"{dataset.source}: there is no pattern '{pattern}'; there are: "
            f"{', '.join(dataset.patterns)}"
        )
    if not dataset.patterns[pattern].fixed:
        raise DatasetError(
            f"{dataset.source}: pattern '{pattern}' is not fixed in its parent_link, so that no "
            f"hand-eye calibration can use it; set `fixed: true` in the configuration if it is"
        )


def _check_rigid(dataset: Dataset, keys: Sequence[str], one: str, other: str) -> None:
    """Refuse two frames that move against each other."""
    graph = dataset.graph
    poses = [pose(dataset.collections[key], graph, one, other) for key in keys]
    if not _constant(poses):
        raise DatasetError(
            f"{dataset.source}: frame '{one}' moves against '{other}', which it is to stand for; "
            f"name the frame that carries it"
        )


def _constant(poses: Sequence[np.ndarray]) -> bool:
    return all(np.max(np.abs(found - poses[0])) <= _CONSTANT for found in poses)


def undetermined(G: Sequence[np.ndarray]) -> str:
    """Return why motions do not tell X; empty where they do.

    Args:
        G: poses (4, 4), one for each collection.
    """
    relative = [se3.inverse(G[0]) @ other for other in G[1:]]
    turns = np.array([se3.rotation_vector_from_rotation(m[:3, :3]) for m in relative])
    moves = np.array([m[:3, 3] for m in relative])
    if np.max(np.abs(turns)) < _MOVED_RAD and np.max(np.abs(moves)) < _MOVED_M:
        return (
            "neither of them moves between the collections, so that nothing ties the camera to "
            "the robot; move the arm that carries one of them"
        )
    spread = np.linalg.svd(turns, compute_uv=False) / np.sqrt(len(turns))
    if spread[0] < _TURNED_RAD:
        return (
            "the arm only translates, it never turns: the camera's translation is undetermined; "
            "collect with turns about two axes"
        )
    if spread[1] < _TURNED_RAD:
        return (
            "the arm turns about one axis only: the camera's translation along it is "
            "undetermined; collect with turns about two axes"
        )
    return ""


def depends_on_calibration(dataset: Dataset, camera: str, pattern: str) -> bool:
    """Tell whether a camera and a fixed board move against each other between collections."""
    graph, sides = dataset.graph, usual_sides(dataset, camera, pattern)
    poses = [
        pose(collection, graph, sides.of_board, sides.of_camera)
        for collection in dataset.collections.values()
        if (camera, pattern) in collection.labels
    ]
    return any(np.max(np.abs(found - poses[0])) > _MOVED_M for found in poses)


def with_hand_eye(
    dataset: Dataset, camera: str, pattern: str, views: HandEyeViews, X: np.ndarray
) -> Dataset:
    """Return the dataset with a hand-eye result in the camera's edge, in all collections.

    The board is put where the result sees it, on average over the collections.

    Args:
        dataset: what the views are of.
        camera: of the views.
        pattern: likewise.
        views: for their frames.
        X: ``camera_side_T_frame`` (4, 4), of the frame that the views name.
    """
    sensor, graph = dataset.sensors[camera], dataset.graph
    first = dataset.collections[views.collections[0]]
    parent_T_side = pose(first, graph, sensor.edge.parent, views.sides.of_camera)
    frame_T_child = pose(first, graph, views.frame, sensor.edge.child)
    board = dataset.patterns[pattern]
    board_T_side = pose(first, graph, board.parent_frame, views.sides.of_board)
    seen = mean_pose([g @ X @ h for g, h in zip(views.G, views.H)])
    edges = {
        sensor.edge: parent_T_side @ X @ frame_T_child,
        board_edge(board): board_T_side @ seen,
    }
    return dataset.with_transforms(dict.fromkeys(dataset.collections, edges))


def mean_pose(poses: Sequence[np.ndarray]) -> np.ndarray:
    """Return the mean (4, 4) of poses that differ by less than a quarter turn."""
    u, _, vt = np.linalg.svd(np.sum([p[:3, :3] for p in poses], axis=0))
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return se3.transform(u @ proper @ vt, np.mean([p[:3, 3] for p in poses], axis=0))
