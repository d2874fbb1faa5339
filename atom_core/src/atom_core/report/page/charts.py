"""Figures of numbers, drawn on axes of matplotlib: arrays in, marks out.

Colours keep apart for every kind of colour vision (Okabe and Ito), and nothing is told by colour
alone. Nothing here knows where the numbers come from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry.robust_sigma import robust_sigma

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, ORANGE, GREEN, RED = "#0072b2", "#b25000", "#00735a", "#b3261e"
INK, GREY, PALE = "#22272b", "#5b6770", "#c9d1d6"
_BINS = 41
_GRID = 8  # cells of the longer side of an image
_LEAST_IN_CELL = 4
_MARK = 3.0
_ROOM_FOR_LEGEND = 1.6  # length of an axis, in longest bars


def fitted_sigma(values: np.ndarray) -> float:
    """Return `robust_sigma` of values (n,), 0 of none."""
    return robust_sigma(values) if len(values) else 0.0


def draw_histogram(axes: Axes, values: np.ndarray, unit: str, what: str) -> None:
    """Draw how often residuals (n,) occur, and the normal distribution that fits."""
    sigma = fitted_sigma(values)
    limit = max(5.0 * sigma, 1e-9)
    edges = np.linspace(-limit, limit, _BINS + 1)
    inside = values[np.abs(values) <= limit]
    axes.hist(inside, edges, color=PALE, edgecolor=GREY, linewidth=0.5)
    x = np.linspace(-limit, limit, 200)
    height = len(values) * (edges[1] - edges[0]) / (max(sigma, 1e-12) * np.sqrt(2.0 * np.pi))
    axes.plot(x, height * np.exp(-0.5 * (x / max(sigma, 1e-12)) ** 2), color=BLUE, linewidth=1.8)
    axes.set_xlabel(f"{what} [{unit}]")
    axes.set_ylabel("number")


def draw_scatter(axes: Axes, residual_px: np.ndarray) -> None:
    """Draw reprojection errors (n, 2), with circles of one, two and three fitted sigmas."""
    sigma = fitted_sigma(np.ravel(residual_px))
    limit = max(6.0 * sigma, 1e-9)
    shown = np.clip(residual_px, -limit, limit)
    axes.scatter(*shown.T, s=_MARK, color=BLUE, alpha=0.4, linewidths=0)
    angles = np.linspace(0.0, 2.0 * np.pi, 100)
    for times in (1, 2, 3):
        axes.plot(
            *(times * sigma * np.array([np.cos(angles), np.sin(angles)])), color=INK, linewidth=0.8
        )
    axes.set_xlim(-limit, limit)
    axes.set_ylim(limit, -limit)
    axes.set_aspect("equal")
    axes.set_xlabel("x error [px]")
    axes.set_ylabel("y error [px], down")


def cell_means(
    places: np.ndarray, values: np.ndarray, size: Tuple[float, float]
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return means of values by cells of an image.

    Args:
        places: (n, 2) [px].
        values: (n, k).
        size: width and height of the image [px].

    Returns:
        Centres of the cells (rows, columns, 2), means (rows, columns, k), NaN where there are few,
        and counts (rows, columns).
    """
    step = max(size) / _GRID
    columns, rows = (max(1, int(np.ceil(length / step))) for length in size)
    cell = np.floor((places + 0.5) / step).astype(int)
    cell = np.clip(cell, 0, [columns - 1, rows - 1])
    index = cell[:, 1] * columns + cell[:, 0]
    counts = np.bincount(index, minlength=rows * columns)
    sums = [np.bincount(index, column, minlength=rows * columns) for column in values.T]
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(counts >= _LEAST_IN_CELL, np.array(sums) / counts, np.nan)
    x, y = np.meshgrid((np.arange(columns) + 0.5) * step, (np.arange(rows) + 0.5) * step)
    shape = (rows, columns)
    return np.dstack([x, y]), means.T.reshape(*shape, -1), counts.reshape(shape)


def longest_mean(
    places: np.ndarray, residual: np.ndarray, size: Tuple[float, float]
) -> Optional[float]:
    """Return the length of the longest arrow that `draw_image_plane` draws; None without any."""
    means = np.linalg.norm(cell_means(places, residual, size)[1], axis=2)
    if residual.shape[1] != 2 or not np.any(np.isfinite(means)):
        return None
    return float(np.nanmax(means))


def draw_image_plane(
    axes: Axes, places: np.ndarray, residual: np.ndarray, size: Tuple[float, float], unit: str
) -> None:
    """Draw residuals over the image: how large they are as a map, their means as arrows.

    The longest arrow is as long as a cell.

    Args:
        axes: to draw on.
        places: (n, 2) where they were seen [px].
        residual: (n, 2) of corners, (n, 1) of points.
        size: width and height of the image [px].
        unit: of the residuals.
    """
    centres, means, _ = cell_means(places, residual, size)
    _, squares, _ = cell_means(places, np.sum(residual**2, axis=1)[:, None], size)
    rms = np.sqrt(squares[..., 0])
    rows, columns = rms.shape
    step = max(size) / _GRID
    extent = (-0.5, columns * step - 0.5, rows * step - 0.5, -0.5)
    brightest = 1.7 * float(np.nanmax(rms)) if np.any(np.isfinite(rms)) else 1.0
    shown = axes.imshow(
        np.ma.masked_invalid(rms), extent=extent, cmap="Blues", vmin=0.0, vmax=brightest
    )
    if residual.shape[1] == 2 and np.any(np.isfinite(means)):
        longest = float(np.nanmax(np.linalg.norm(means, axis=2)))
        x, y, u, v = (a.ravel() for a in (*np.moveaxis(centres, 2, 0), *np.moveaxis(means, 2, 0)))
        scale = max(longest, 1e-12) / (0.8 * step)
        axes.quiver(
            *(x, y, u, v), angles="xy", scale_units="xy", scale=scale, color=INK, width=0.008
        )
    axes.set_xlabel("x [px]")
    axes.set_ylabel("y [px]")
    axes.set_xlim(-0.5, size[0] - 0.5)
    axes.set_ylim(size[1] - 0.5, -0.5)
    bar = axes.figure.colorbar(shown, ax=axes, fraction=0.035, pad=0.02)
    bar.set_label(f"RMS [{unit}]")


def draw_along(axes: Axes, along: np.ndarray, residual: np.ndarray, label: str, unit: str) -> None:
    """Draw residuals (n,) against something (n,), with median and quartiles by parts of it."""
    limit = max(6.0 * fitted_sigma(residual), 1e-9)
    axes.scatter(
        along, np.clip(residual, -limit, limit), s=_MARK, color=BLUE, alpha=0.25, linewidths=0
    )
    ends = np.unique(np.quantile(along, np.linspace(0.0, 1.0, 9)))
    if len(ends) > 2:
        part = np.clip(np.searchsorted(ends, along, side="right") - 1, 0, len(ends) - 2)
        parts = [residual[part == i] for i in range(len(ends) - 1)]
        kept = [i for i, p in enumerate(parts) if len(p) >= _LEAST_IN_CELL]
        middles = 0.5 * (ends[:-1] + ends[1:])[kept]
        low, middle, high = np.array(
            [np.quantile(parts[i], (0.25, 0.5, 0.75)) for i in kept]
        ).T.reshape(3, -1)
        axes.fill_between(middles, low, high, color=ORANGE, alpha=0.35, linewidth=0)
        axes.plot(middles, middle, color=ORANGE, linewidth=2.0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_ylim(-limit, limit)
    axes.set_xlabel(label)
    axes.set_ylabel(f"residual [{unit}]")


def draw_on_board(
    axes: Axes, places: np.ndarray, residual_mm: np.ndarray, outline: np.ndarray
) -> None:
    """Draw residuals of points (n,) at their places (n, 2) on a board with corners (4, 2) [m]."""
    limit = max(3.0 * fitted_sigma(residual_mm), 1e-9)
    shown = axes.scatter(
        *places.T, c=residual_mm, s=3.0 * _MARK, cmap="PuOr", vmin=-limit, vmax=limit, linewidths=0
    )
    axes.plot(*np.concatenate([outline, outline[:1]]).T, color=INK, linewidth=1.0)
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.figure.colorbar(shown, ax=axes, fraction=0.035, pad=0.02).set_label("residual [mm]")


def draw_coverage(axes: Axes, pixels: np.ndarray, size: Tuple[float, float]) -> None:
    """Draw where in an image boards were seen: (n, 2) [px]."""
    axes.scatter(*pixels.T, s=_MARK, color=BLUE, alpha=0.4, linewidths=0)
    for axis, length in ((axes.axvline, size[0]), (axes.axhline, size[1])):
        for third in (1, 2):
            axis(third * length / 3.0, color=PALE, linewidth=0.8)
    axes.set_xlim(-0.5, size[0] - 0.5)
    axes.set_ylim(size[1] - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xlabel("x [px]")
    axes.set_ylabel("y [px]")


def draw_directions(axes: Axes, points: np.ndarray) -> None:
    """Draw in which directions boards were seen: points (n, 3) in the sensor's frame."""
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    axes.scatter(azimuth, elevation, s=_MARK, color=BLUE, alpha=0.4, linewidths=0)
    axes.set_xlim(180.0, -180.0)
    axes.set_xticks(range(-180, 181, 90))
    axes.set_ylim(-60.0, 60.0)
    axes.set_xlabel("azimuth [deg]")
    axes.set_ylabel("elevation [deg]")


def draw_tilts(axes: Axes, distance_m: np.ndarray, tilt_deg: np.ndarray) -> None:
    """Draw at which distances (n,) and tilts (n,) boards were seen."""
    axes.scatter(distance_m, tilt_deg, s=26, color=ORANGE, edgecolors=INK, linewidths=0.6)
    axes.set_xlim(0.0, 1.15 * float(np.max(distance_m)) if len(distance_m) else 1.0)
    axes.set_ylim(0.0, 90.0)
    axes.set_yticks(range(0, 91, 15))
    axes.set_xlabel("distance [m]")
    axes.set_ylabel("tilt [deg]")


def draw_bars(
    axes: Axes, names: Sequence[str], groups: Mapping[str, Sequence[Optional[float]]], unit: str
) -> None:
    """Draw horizontal bars by name, one of each group beside one another; None is no bar."""
    colours, hatches = (BLUE, PALE, ORANGE, GREEN), ("", "//", "..", "xx")
    height = 0.8 / max(len(groups), 1)
    for i, (group, values) in enumerate(groups.items()):
        places = np.arange(len(names)) + (i + 0.5) * height - 0.4
        lengths = [0.0 if value is None else value for value in values]
        look: Dict[str, Any] = {"color": colours[i % 4], "hatch": hatches[i % 4]}
        axes.barh(places, lengths, 0.9 * height, label=group, edgecolor=INK, linewidth=0.5, **look)
    axes.set_yticks(range(len(names)))
    axes.set_yticklabels(names)
    axes.invert_yaxis()
    axes.set_xlabel(f"[{unit}]")
    if len(groups) > 1:
        axes.set_xlim(0.0, _ROOM_FOR_LEGEND * axes.get_xlim()[1])
        axes.legend(loc="lower right", frameon=False)


def draw_limit(
    axes: Axes, names: Sequence[str], values: Sequence[float], limit: float, label: str
) -> None:
    """Draw horizontal bars by name, and the limit that they shall not pass."""
    colours = [RED if value > limit else BLUE for value in values]
    axes.barh(range(len(names)), values, color=colours, edgecolor=INK, linewidth=0.5)
    axes.axvline(limit, color=INK, linewidth=1.5, linestyle="--")
    axes.set_yticks(range(len(names)))
    axes.set_yticklabels(names, fontsize=7)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.15 * max([limit, *values]))
    axes.set_xlabel(label)


def draw_scene(axes: Any, scene: Mapping[str, Any], points: List[np.ndarray]) -> None:
    """Draw the rig on axes of three dimensions.

    Args:
        axes: of matplotlib's 3D toolkit.
        scene: as of `scene.rig_scene`.
        points: (n, 3) [m] of one collection.
    """
    for cloud in points:
        axes.scatter(*cloud.T, s=0.6, color=PALE, linewidths=0, rasterized=True)
    for board in scene["boards"]:
        corners = np.array([*board["corners"], board["corners"][0]])
        axes.plot(*corners.T, color=GREY, linewidth=0.5)
    places = []
    for sensor in scene["sensors"]:
        for word, colour, style in (("before", GREY, ":"), ("after", sensor["colour"], "-")):
            lines = sensor[word]
            if lines is not None:
                gap = [np.nan] * 3
                corners = np.array([gap if p is None else p for p in lines])
                axes.plot(*corners.T, color=colour, linewidth=1.4, linestyle=style)
        if "place" in sensor:
            places.append(sensor["place"])
            axes.text(*sensor["place"], " " + sensor["name"], color=INK, fontsize=8)
    shown = [c for b in scene["boards"] for c in b["corners"]] + places
    if shown:
        low, high = np.min(shown, axis=0), np.max(shown, axis=0)
        middle, half = 0.5 * (low + high), 0.5 * float(np.max(high - low)) or 1.0
        axes.set_xlim(middle[0] - half, middle[0] + half)
        axes.set_ylim(middle[1] - half, middle[1] + half)
        axes.set_zlim(middle[2] - half, middle[2] + half)
    for named, title in zip((axes.set_xlabel, axes.set_ylabel, axes.set_zlabel), scene["axes"]):
        named(title)
    axes.view_init(elev=28, azim=-60)
