"""Each camera by itself: how far its corners are from where the calibration puts the board.

A board that is fixed in its parent has one pose for the whole test set, the one that suits the
camera's corners best: what is left are errors of the hand-eye calibration, of the robot and of the
labels. A board that is moved by hand has a pose of its own in each image: what is left are errors
of labels and intrinsics, whatever the camera's place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Collection, Dict, List, Mapping, Optional, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.fixed_board import BoardView, fixed_board_pose, offsets_px
from atom_core.evaluation.hand_eye_views import depends_on_calibration
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.own_edges import own_edge_between
from atom_core.evaluation.results import PairFigures, summarised
from atom_core.evaluation.statistics import Errors
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.sensor import RGB
from atom_core.model.transforms import Edge

_CONSTANT = 1e-9


@dataclass(frozen=True)
class SingleCamera:
    """Reprojection errors of a camera and a pattern [px].

    Attributes:
        sensor, pattern: which.
        one_pose: the board has one pose in all images; else one by each image alone.
        tells_of_calibration: the camera's place enters: the board has one pose, and either of the
            two moves.
        measured: by collection; None if there is nothing.
        at_truth: likewise with the true edges; None without a truth, or where they do not enter.
        skipped: why nothing was measured.
    """

    sensor: str
    pattern: str
    one_pose: bool
    tells_of_calibration: bool
    measured: Optional[PairFigures]
    at_truth: Optional[PairFigures] = None
    skipped: Optional[str] = None


def single_cameras(
    dataset: Dataset,
    observed: Observed,
    true: Optional[Dataset] = None,
    boards: Optional[Dataset] = None,
    own: Collection[Edge] = (),
) -> List[SingleCamera]:
    """Measure every camera with every pattern that it detects.

    Args:
        dataset: the test set with the calibrated edges.
        observed: its labels.
        true: the test set with the true edges.
        boards: where fixed boards are taken from, instead of fitting them; None: they are fitted.
        own: edges that are the test set's own (`own_edges`); a fitted board beyond one has
            a pose for each image.

    Raises:
        DatasetError: ``boards`` lacks the pose of a fixed board.
    """
    results = []
    for sensor in dataset.sensors.values():
        for pattern in dataset.patterns.values():
            keys = [
                key
                for key, _ in dataset.detections()
                if (key.sensor, key.pattern) == (sensor.name, pattern.name)
            ]
            if sensor.modality == RGB and keys:
                across = own_edge_between(dataset, own, pattern.parent_frame, sensor.frame)
                fixed = pattern.fixed and (across is None or boards is not None)
                results.append(_single(dataset, observed, true, boards, keys, fixed))
    return results


def _single(
    dataset: Dataset,
    observed: Observed,
    true: Optional[Dataset],
    boards: Optional[Dataset],
    keys: List[DetectionKey],
    fixed: bool,
) -> SingleCamera:
    sensor, pattern = keys[0].sensor, keys[0].pattern
    tells = fixed and depends_on_calibration(dataset, sensor, pattern)
    kind = (sensor, pattern, fixed, tells)
    views = {key.collection: view for key, view in _views(dataset, observed, keys).items()}
    if not views:
        why = f"the corners of '{sensor}' do not determine the board's pose in any collection"
        return SingleCamera(*kind, measured=None, skipped=why)
    if not fixed:
        return SingleCamera(*kind, _summary(pattern, views, None))
    held = None if boards is None else _board_of(boards, pattern)
    floor = None
    if true is not None and tells:
        of_truth = {key.collection: view for key, view in _views(true, observed, keys).items()}
        floor = _summary(pattern, of_truth, fixed_board_pose(list(of_truth.values())))
    board = fixed_board_pose(list(views.values())) if held is None else held
    return SingleCamera(*kind, _summary(pattern, views, board), floor)


def _views(
    dataset: Dataset, observed: Observed, keys: List[DetectionKey]
) -> Dict[DetectionKey, BoardView]:
    graph, views = dataset.graph, {}
    for key in keys:
        frame = dataset.sensors[key.sensor].frame
        parent = dataset.patterns[key.pattern].parent_frame
        camera_T_parent = pose(dataset.collections[key.collection], graph, frame, parent)
        try:
            camera_T_pattern = observed.camera_T_pattern(key)
        except NotMeasurableError:
            continue
        views[key] = BoardView(observed.corners(key), camera_T_parent, camera_T_pattern)
    return views


def _summary(
    pattern: str, views: Mapping[str, BoardView], parent_T_pattern: Optional[np.ndarray]
) -> PairFigures:
    """Return the errors of some images; without a pose of the board by each image's own."""
    errors: Dict[Tuple[str, str], Errors] = {}
    for collection, view in views.items():
        board = parent_T_pattern
        if board is None:
            board = np.linalg.solve(view.camera_T_parent, view.camera_T_pattern)
        errors[collection, pattern] = Errors.in_image(offsets_px(view, board))
    return summarised(errors)


def _board_of(boards: Dataset, pattern: str) -> np.ndarray:
    edge = board_edge(boards.patterns[pattern])
    found = [c.transforms[edge] for c in boards.collections.values() if edge in c.transforms]
    if not found:
        raise DatasetError(
            f"{boards.source}: there is no transform '{edge}' of pattern '{pattern}'; give a "
            f"calibrated dataset, or leave -cpt out"
        )
    if any(np.max(np.abs(other - found[0])) > _CONSTANT for other in found):
        raise DatasetError(
            f"{boards.source}: pattern '{pattern}' is in several places; leave -cpt out"
        )
    return found[0]
