"""2D LiDARs: the cut of the board in a scan, and those of its ends that are the board's edge."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Mapping, Optional

import numpy as np

from atom_core.evaluation.label_quality import METRES, LabelQuality, quality_of_distances
from atom_core.evaluation.pairs import PairKind, border_in_depth_image, border_in_image
from atom_core.evaluation.plane_pairs import to_plane_of_corners, to_plane_of_points
from atom_core.evaluation.scan_pairs import cuts_in_one_plane
from atom_core.geometry import se3
from atom_core.geometry.line import fit_line
from atom_core.geometry.rays import spinning_rays
from atom_core.io.label_json import range_label_format
from atom_core.labeling.lidar2d import Lidar2dLabeler
from atom_core.model.dataset import Dataset, range_points
from atom_core.model.labels import DetectionKey, RangeLabel, RangePoints
from atom_core.model.laser_scan import LaserScan, fields_of, scan_from_fields
from atom_core.model.modality import DataFormat, Modality, SeedFormat
from atom_core.model.pattern import Pattern
from atom_core.model.range_points import points_of_cloud
from atom_core.model.sensor import DEPTH, LIDAR2D, LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.problem.scan_measurement import measured_in_scan, scan_blocks
from atom_core.synthetic.lidar2d import Around, Lidar2dModel, scan
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import RangeErrors
from atom_core.synthetic.realism import Realism
from atom_core.synthetic.rig import LIDAR_HEIGHT_M, Mount, Rig
from atom_core.synthetic.sensing import Outlook, SyntheticSensor, View


def _read(_: Optional[Path], entry: Mapping[str, Any]) -> LaserScan:
    return scan_from_fields(entry)


def _entry(_: Sensor, data: LaserScan) -> Dict[str, Any]:
    """Return the scan as JSON has it: ``ranges`` stand in the dataset's JSON itself."""
    return fields_of(data)


def _points(dataset: Dataset, key: DetectionKey) -> RangePoints:
    return points_of_cloud(dataset.data.read(key.collection, key.sensor).points, dataset, key)


def _quality(dataset: Dataset, key: DetectionKey) -> LabelQuality:
    """Return how well the labeled points lie on one line."""
    label, found = dataset.label(key), range_points(dataset, key)
    assert label is not None
    try:
        away_m = fit_line(found.inside).distances
    except ValueError:  # too few, or in one place
        return LabelQuality(label.size, label.limit_size, METRES)
    return quality_of_distances(label, found, away_m)


def _mount(name: str, beam: str, beam_T_base: np.ndarray, model: Any) -> Mount:
    """Return a LiDAR: beam -> base link (calibrated) -> data frame."""
    edge = Edge(beam, f"{name}_base_link")
    base_T_lidar = se3.transform(np.eye(3), np.array([0.0, 0.0, LIDAR_HEIGHT_M]))
    edges = {edge: beam_T_base, Edge(edge.child, name): base_T_lidar}
    sensor = Sensor(name, LIDAR2D, name, edge, topic=f"/{name}/scan")
    return Mount(sensor, edges, model or Lidar2dModel())


def _observe(view: View) -> Dict[str, RangeLabel]:
    """Return the labels of the boards in a scan, and keep the scan."""
    data, labels = scan(
        view.rig.lidars[view.sensor.name],
        {name: (pose, view.patterns[name]) for name, pose in view.sensor_T_patterns.items()},
        Around(view.world_T_sensor, view.rig.room),
        view.noise,
        view.rng,
        errors=view.errors if isinstance(view.errors, RangeErrors) else RangeErrors(),
        errors_rng=view.errors_rng,
    )
    view.data.add(view.collection, view.sensor.name, data)
    return labels


def _outlook(rig: Rig, sensor: Sensor, lidar_T_pattern: np.ndarray, pattern: Pattern) -> Outlook:
    """Tell what a 2D LiDAR would make of a board, by a scan without noise."""
    model, boards = rig.lidars[sensor.name], {pattern.name: (lidar_T_pattern, pattern)}
    around, exact = Around(rig.pose(sensor.frame), rig.room), Noise(lidar_m=0.0)
    _, labels = scan(model, boards, around, exact, np.random.default_rng(0))
    label = labels.get(pattern.name)
    return Outlook(label is not None, False, 0 if label is None else label.rows)


def _errors(realism: Realism, _: Sensor, __: Any, rng: np.random.Generator) -> RangeErrors:
    return RangeErrors.drawn(realism, 0, rng)


_PAIRS = (
    PairKind("lidar2d-rgb", LIDAR2D, RGB, "border_reprojection", "px", False, border_in_image),
    PairKind("lidar2d-rgb_plane", LIDAR2D, RGB, "point_to_plane", "mm", False, to_plane_of_corners),
    PairKind(
        "lidar2d-depth", LIDAR2D, DEPTH, "border_reprojection", "px", False, border_in_depth_image
    ),
    PairKind(
        "lidar2d-depth_plane", LIDAR2D, DEPTH, "point_to_plane", "mm", False, to_plane_of_points
    ),
    PairKind(
        "lidar2d-lidar3d", LIDAR2D, LIDAR3D, "point_to_plane", "mm", False, to_plane_of_points
    ),
    PairKind(  # two lines are nearly in one plane in many wrong calibrations, too
        "lidar2d-lidar2d",
        *(LIDAR2D, LIDAR2D, "coplanarity", "mm", False, cuts_in_one_plane),
        proves=False,
    ),
)

LIDAR_2D = Modality(
    name=LIDAR2D,
    noun="lidar2d sensor",
    message_types=("sensor_msgs/LaserScan",),
    is_default_of=("sensor_msgs/LaserScan",),
    measures_range=True,
    can_estimate_range_offset=True,
    spins_about_z=True,
    data=DataFormat(message="LaserScan", ending="", read=_read, write=None, entry=_entry),
    labels=range_label_format("edge_idxs"),
    seed=SeedFormat("xyz_m", 3, "m"),
    points=_points,
    measured=lambda scan: scan.valid,
    labeler=Lidar2dLabeler,
    measure=measured_in_scan,
    residual_blocks=scan_blocks,
    rays=lambda sensor: spinning_rays((0.0,)),
    quality=_quality,
    pairs=_PAIRS,
    synthetic=SyntheticSensor(_mount, _observe, _outlook, _errors),
)
