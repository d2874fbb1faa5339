"""Render the pictures of the documents from the simulated cell: `make pictures`.

``pictures/cell.png`` shows the cell with its sensors before and after a calibration,
``pictures/residuals.png`` what a camera and a LiDAR measured against what the poses say.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import List, NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.patheffects as effects
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.calibration.start.boards import initial_boards
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, is_complete, pose, range_points
from atom_core.model.labels import DetectionKey, RgbLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.problem.measurements import read_measurements
from atom_core.synthetic import Noise, paper_cell

SEED, DISTURBANCE = 0, (0.1, 0.1)
FOLDER = Path(__file__).resolve().parent / "pictures"
COLOURS = {RGB: "#1f6fb4", DEPTH: "#2a9150", LIDAR3D: "#d9641a"}
WORDS = {RGB: "rgb", DEPTH: "depth", LIDAR3D: "3D LiDAR"}
GREY, INK, WRONG = "#868d93", "#2b2f33", "#c8324b"
DPI = 100
# Where the names stand beside their sensors, in world [m], so that none covers another.
NAME_PLACES = {
    "rgb_1": (-0.15, 0.0, 0.24),
    "rgb_2": (0.10, 0.0, 0.24),
    "rgb_3": (-0.10, 0.0, 0.52),
    "depth_1": (0.42, 0.0, 0.20),
    "lidar_1": (0.0, 0.0, -0.52),
    "lidar_2": (-0.55, 0.0, 0.10),
    "lidar_3": (0.10, 0.0, 0.38),
}
VIEW_ASPECT = 1.57  # of the panels with the residuals
HALO = [effects.withStroke(linewidth=3, foreground="white")]
# Beams and legs of the gantry, ends in world [m] (the lengths are those of the drawing).
LEGS = [((x, y, 0.0), (x, y, 2.25)) for x in (-1.91, 1.91) for y in (-1.31, 1.31)]
BEAMS = [
    *[((-2.41, y, 2.29), (2.59, y, 2.29)) for y in (-1.31, 1.31)],
    *[((x, -1.89, 2.38), (x, 1.91, 2.38)) for x in (-1.82, 1.98)],
    *[((x, -1.49, 2.29), (x, 1.51, 2.29)) for x in (-0.955, 0.045, 1.045)],
]

Segments = List[np.ndarray]


class States(NamedTuple):
    """The cell with the sensors as guessed, and as calibrated; boards as each knows them."""

    before: Dataset
    after: Dataset


def main() -> None:
    """Write both pictures."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="DIR")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    cell = paper_cell(SEED, "train", Noise(), DISTURBANCE)
    states = before_and_after(calibrate(cell.dataset))
    for name, draw in (("cell.png", draw_cell), ("residuals.png", draw_residuals)):
        figure = draw(states)
        figure.savefig(folder / name, dpi=DPI, facecolor="white", metadata={"Software": None})
        plt.close(figure)
        print(folder / name)  # noqa: T201


def before_and_after(calibration: Calibration) -> States:
    """Return the start of a calibration, boards placed by its sensors, and the end."""
    initial = calibration.initial
    measurements, _ = read_measurements(initial)
    boards = initial_boards(initial, measurements, calibration.free)
    edge = calibration.problem.parameters.blocks[-1].edge
    placed = {key: {edge: boards[("pattern_1", key)]} for key in initial.collections}
    return States(initial.with_transforms(placed), calibration.dataset)


# ---------------------------------------------------------------------------------- cell


def draw_cell(states: States) -> plt.Figure:
    """Return the cell in 3D, and one board edge-on with the points of all range sensors."""
    figure = plt.figure(figsize=(12.0, 6.4))
    axes = figure.add_axes((-0.08, -0.085, 0.92, 1.12), projection="3d", computed_zorder=False)
    axes.view_init(elev=22, azim=-66)
    axes.set_proj_type("persp", focal_length=1.3)
    axes.set_axis_off()
    axes.set_xlim(-2.2, 2.2)
    axes.set_ylim(-2.0, 2.0)
    axes.set_zlim(0.0, 2.4)
    axes.set_box_aspect((4.4, 4.0, 2.4), zoom=1.16)
    _add_room(axes)
    key = _highest_board(states.after)
    _add_boards(axes, states.after, key)
    for sensor in states.after.sensors.values():
        _add_sensor(axes, states, key, sensor)
    for drawn in axes.collections:  # the panel is narrower than the cell is long
        drawn.set_clip_on(False)
    figure.text(0.02, 0.945, "One optimisation for all sensors of the cell", size=16, color=INK)
    figure.text(
        0.02,
        0.905,
        "grey: as guessed, 0.1 m and 0.1 rad off     colour: calibrated",
        size=11,
        color="#5f6468",
    )
    handles = [
        Line2D([], [], color=COLOURS[m], linewidth=3, label=WORDS[m]) for m in (RGB, DEPTH, LIDAR3D)
    ]
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.01, 0.01), ncol=3, frameon=False
    )
    for state, title, bottom in ((states.before, "before", 0.56), (states.after, "after", 0.12)):
        side = figure.add_axes((0.765, bottom, 0.215, 0.31))
        _draw_edge_on(side, state, states.after, key, title)
    figure.text(
        0.765,
        0.905,
        "One board edge-on: labeled\npoints of all range sensors [mm]",
        size=10.5,
        color=INK,
        va="center",
    )
    return figure


def _add_room(axes: plt.Axes) -> None:
    floor = [[(-2.4, -2.0, 0), (2.4, -2.0, 0), (2.4, 2.0, 0), (-2.4, 2.0, 0)]]
    axes.add_collection3d(Poly3DCollection(floor, facecolor="#f4f5f6", edgecolor="none", zorder=0))
    lines = [np.array([(x, -2.0, 0), (x, 2.0, 0)]) for x in np.arange(-2.4, 2.5, 0.4)]
    lines += [np.array([(-2.4, y, 0), (2.4, y, 0)]) for y in np.arange(-2.0, 2.1, 0.4)]
    axes.add_collection3d(Line3DCollection(lines, colors="#e3e6e8", linewidths=0.8, zorder=1))
    axes.add_collection3d(Line3DCollection(LEGS, colors="#c9cdd1", linewidths=5, zorder=2))
    axes.add_collection3d(Line3DCollection(BEAMS, colors="#c9cdd1", linewidths=4, zorder=2))


def _add_boards(axes: plt.Axes, state: Dataset, shown: str) -> None:
    """Draw the boards that all sensors see as outlines, and one of them with its squares."""
    pattern = state.patterns["pattern_1"]
    for key in [key for key in state.collections if is_complete(state, key)]:
        world_T_pattern = _world_T_pattern(state, key)
        chosen = key == shown
        outline = se3.apply(world_T_pattern, _in_plane(pattern.border.corners))
        board = Poly3DCollection(
            [outline],
            facecolor="white" if chosen else "#f3e6b8",
            edgecolor="#8a7a3c",
            linewidth=1.2 if chosen else 0.6,
            alpha=1.0 if chosen else 0.28,
            zorder=5 if chosen else 3,
        )
        axes.add_collection3d(board)
        if chosen:
            squares = [se3.apply(world_T_pattern, _in_plane(s)) for s in _dark_squares(pattern)]
            axes.add_collection3d(
                Poly3DCollection(squares, facecolor="#4a4f54", edgecolor="none", zorder=6)
            )


def _dark_squares(pattern: Pattern) -> Segments:
    side = pattern.square_m
    unit = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * side
    return [
        unit + np.array([column, row]) * side
        for row in range(pattern.rows + 1)
        for column in range(pattern.columns + 1)
        if (row + column) % 2 == 0
    ]


def _add_sensor(axes: plt.Axes, states: States, key: str, sensor: Sensor) -> None:
    name = sensor.name
    colour = COLOURS[sensor.modality]
    poses = [pose(s.collections[key], s.graph, s.world, sensor.frame) for s in states]
    held = np.allclose(*poses)
    for world_T_sensor, is_after in zip(poses, (False, True)):
        if held and not is_after:
            continue
        shape = [se3.apply(world_T_sensor, line) for line in _shape(sensor)]
        look = {"colors": colour if is_after else GREY, "linewidths": 1.9 if is_after else 1.2}
        axes.add_collection3d(Line3DCollection(shape, zorder=9 if is_after else 8, **look))
    to_board = _world_T_pattern(states.after, key)
    middle = se3.apply(
        to_board, np.append(states.after.patterns["pattern_1"].border.centre, 0)[None]
    )
    if DetectionKey(key, name, "pattern_1") in dict(states.after.detections()):
        ray = np.vstack([poses[1][:3, 3], middle[0]])
        axes.add_collection3d(
            Line3DCollection([ray], colors=colour, linewidths=0.8, linestyles=":", zorder=7)
        )
    axes.scatter(*poses[1][:3, 3], color=colour, s=28, zorder=10, depthshade=False)
    text = f"{name} (held)" if held else name
    axes.text(
        *(poses[1][:3, 3] + NAME_PLACES[name]),
        text,
        color=colour,
        size=11,
        weight="bold",
        ha="center",
        zorder=20,
        path_effects=HALO,
    )


def _shape(sensor: Sensor) -> Segments:
    """Return lines (n, 3) in the sensor's frame: a camera's field of view, a LiDAR's layers."""
    if sensor.camera is not None:
        size = np.array([sensor.camera.width, sensor.camera.height])
        pixels = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size - 0.5
        far = sensor.camera.ray_points(pixels, np.full(4, 0.42))
        return [np.vstack([far, far[:1]]), *[np.vstack([np.zeros(3), corner]) for corner in far]]
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    rings = []
    for elevation in np.radians((-15.0, 0.0, 15.0)):
        flat = 0.26 * np.cos(elevation)
        height = np.full_like(turn, 0.26 * np.sin(elevation))
        rings.append(np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height]))
    axis = np.array([(0.0, 0.0, -0.1), (0.0, 0.0, 0.1)])
    return [*rings, axis]


def _draw_edge_on(axes: plt.Axes, state: Dataset, after: Dataset, key: str, title: str) -> None:
    """Draw where the range sensors' points lie across the calibrated board [mm]."""
    pattern_T_world = se3.inverse(_world_T_pattern(after, key))
    border = after.patterns["pattern_1"].border
    axes.plot([1e3 * border.x_min, 1e3 * border.x_max], [0, 0], color="#8a7a3c", linewidth=5)
    for name, sensor in state.sensors.items():
        if sensor.modality == RGB:
            continue
        points = range_points(state, DetectionKey(key, name, "pattern_1")).inside
        world_T_sensor = pose(state.collections[key], state.graph, state.world, sensor.frame)
        on_board = 1e3 * se3.apply(pattern_T_world @ world_T_sensor, points)
        axes.plot(
            on_board[:, 0],
            on_board[:, 2],
            ".",
            markersize=1.6,
            alpha=0.5,
            color=COLOURS[sensor.modality],
        )
    axes.set_xlim(-250, 1000)
    axes.set_ylim(-300, 300)
    axes.set_yticks([-200, 0, 200])
    axes.set_xticks([0, 400, 800])
    axes.tick_params(labelsize=9, color=GREY, labelcolor="#5f6468")
    axes.text(0.03, 0.95, title, transform=axes.transAxes, va="top", size=11, weight="bold")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _highest_board(state: Dataset) -> str:
    """Return the collection of the highest board that all sensors see."""
    complete = [key for key in state.collections if is_complete(state, key)]
    return max(complete, key=lambda key: _world_T_pattern(state, key)[2, 3])


def _world_T_pattern(state: Dataset, key: str) -> np.ndarray:
    frame = state.patterns["pattern_1"].frame
    return pose(state.collections[key], state.graph, state.world, frame)


def _in_plane(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.zeros(len(points))])


# ----------------------------------------------------------------------------- residuals


def draw_residuals(states: States) -> plt.Figure:
    """Return the view of a camera, and the limit points of a LiDAR in the board's plane."""
    figure, axes = plt.subplots(2, 2, figsize=(12.0, 8.6))
    view = _largest_view(states.after)
    figure.subplots_adjust(0.02, 0.02, 0.985, 0.885, wspace=0.04, hspace=0.14)
    for column, (state, title) in enumerate(zip(states, ("before", "after"))):
        _draw_view(axes[0, column], state, view, title)
        _draw_plane(axes[1, column], state, view.collection, title)
    figure.text(0.02, 0.952, "What is minimised", size=16, color=INK)
    handles = [
        Line2D([], [], marker="o", color=COLOURS[RGB], mfc="none", linestyle="", label="detected"),
        Line2D([], [], marker="x", color=WRONG, linestyle="", label="projected"),
        Line2D([], [], marker=".", color=COLOURS[LIDAR3D], linestyle="", label="LiDAR limit point"),
        Line2D([], [], color="#8a7a3c", label="border of the board"),
    ]
    figure.legend(
        handles=handles, loc="upper right", bbox_to_anchor=(0.99, 0.985), ncol=4, frameon=False
    )
    return figure


def _draw_view(axes: plt.Axes, state: Dataset, key: DetectionKey, title: str) -> None:
    """Draw detected and projected corners over the image, around the board."""
    measured = {m.key: m for m in read_measurements(state)[0]}[key]
    camera = measured.camera
    sensor_T_pattern = _sensor_T_pattern(state, key)
    projected = camera.project(se3.apply(sensor_T_pattern, measured.corners_in_pattern))
    image = state.data.read(key.collection, key.sensor)
    pale = 255 - (255 - image[..., 0].astype(int)) // 2
    axes.imshow(pale, cmap="gray", vmin=0, vmax=255)
    axes.set_facecolor(str(pale[0, 0] / 255.0))  # beyond the image
    outline = _in_plane(state.patterns["pattern_1"].border.sample(0.02))
    axes.add_patch(
        Polygon(
            camera.project(se3.apply(sensor_T_pattern, outline)),
            fill=False,
            edgecolor="#8a7a3c",
            linewidth=1.2,
        )
    )
    for seen, said in zip(measured.pixels, projected):
        axes.plot(*zip(seen, said), color=WRONG, linewidth=0.7, alpha=0.7)
    axes.plot(*measured.pixels.T, "o", mfc="none", mec=COLOURS[RGB], markersize=5, mew=1.2)
    axes.plot(*projected.T, "x", color=WRONG, markersize=4.5, mew=1.1)
    _zoom(axes, np.vstack([measured.pixels, projected]), 1.5, VIEW_ASPECT)
    mean = np.mean(np.linalg.norm(projected - measured.pixels, axis=1))
    axes.set_title(f"{key.sensor}, {title}: {_rounded(mean)} px on average", loc="left", size=12)
    _frame(axes)


def _draw_plane(axes: plt.Axes, state: Dataset, collection: str, title: str) -> None:
    """Draw limit points and their distances to the border, in the board's plane."""
    border = state.patterns["pattern_1"].border
    axes.add_patch(Polygon(border.corners, facecolor="#faf5e2", edgecolor="#8a7a3c", linewidth=1.8))
    for square in _dark_squares(state.patterns["pattern_1"]):
        axes.add_patch(Polygon(square, facecolor="#e6e2d3", edgecolor="none"))
    distances = []
    names = [sensor.name for sensor in state.sensors.values() if sensor.modality == LIDAR3D]
    for name in names:
        key = DetectionKey(collection, name, "pattern_1")
        limit = range_points(state, key).limit
        flat = se3.apply(se3.inverse(_sensor_T_pattern(state, key)), limit)[:, :2]
        distance, outward = border.signed_distance(flat)
        for start, end in zip(flat, flat - distance[:, None] * outward):
            axes.plot(*zip(start, end), color=WRONG, linewidth=1.0, alpha=0.8)
        axes.plot(*flat.T, ".", color=COLOURS[LIDAR3D], markersize=8)
        distances.append(np.abs(distance))
    _zoom(axes, border.corners, 1.75, VIEW_ASPECT)
    axes.set_aspect("equal")
    mean = 1e3 * np.mean(np.concatenate(distances))
    axes.set_title(
        f"{len(names)} LiDARs, {title}: {_rounded(mean)} mm to the border on average",
        loc="left",
        size=12,
    )
    _frame(axes)


def _largest_view(state: Dataset) -> DetectionKey:
    """Return the detection that fills most of an image, of free cameras where all sensors see."""
    areas = {
        key: float(np.prod(np.ptp(label.pixels, axis=0)))
        for key, label in state.detections()
        if isinstance(label, RgbLabel)
        and key.sensor != state.config.anchored_sensor
        and is_complete(state, key.collection)
        and len(label.ids) == state.patterns[key.pattern].corner_count
    }
    return max(areas, key=lambda key: areas[key])


def _sensor_T_pattern(state: Dataset, key: DetectionKey) -> np.ndarray:
    frames = state.sensors[key.sensor].frame, state.patterns[key.pattern].frame
    return pose(state.collections[key.collection], state.graph, *frames)


def _zoom(axes: plt.Axes, pixels: np.ndarray, margin: float, aspect: float) -> None:
    """Show the pixels with a margin around them, in a window of the given aspect."""
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    middle, size = (low + high) / 2, margin * (high - low)
    width = max(size[0], size[1] * aspect)
    axes.set_xlim(middle[0] - width / 2, middle[0] + width / 2)
    axes.set_ylim(middle[1] + width / aspect / 2, middle[1] - width / aspect / 2)


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"


def _frame(axes: plt.Axes) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#d5d8db")


if __name__ == "__main__":
    main()
