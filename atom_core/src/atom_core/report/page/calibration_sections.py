"""Sections of a calibration: residuals, detections, coverage, certainty, outliers, its making."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, Dict, List, Mapping, Optional, Sequence, Set, Tuple, Union

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.labeling.guidance import Guidance
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.report.model_error_lines import shown_errors
from atom_core.report.page import charts
from atom_core.report.page.blocks import (
    Block,
    Cell,
    Chart,
    Folded,
    Picture,
    Section,
    Table,
    Text,
    galleries,
)
from atom_core.report.page.given import Document, Given
from atom_core.report.page.views import Sighting
from atom_core.report.residual_samples import ResidualSample, of_sensor
from atom_core.report.tables import ABSENT
from atom_core.report.verdict import is_open, sigma_in_words

_MOST_ROWS = 120  # of the detection matrix
_MOST_OUTLIERS, _MOST_UNUSED = 40, 30
_NOT_SEEN = Cell("·", "none", "not seen")
_CARRIED_M = 2.0
_WORDS = {REPROJECTION: "corners", ORTHOGONAL: "points on the board", BORDER: "border points"}
_SHORT = {REPROJECTION: "corners", ORTHOGONAL: "points", BORDER: "border"}
_NO_RESIDUALS = "the residuals were not kept with this result: its plots are left out"


def millimetres(value: float, unit: str) -> Tuple[float, str]:
    """Return a length in mm, pixels as they are, with the unit."""
    return (1e3 * value, "mm") if unit == "m" else (value, unit)


# ---- residuals


def residuals_section(given: Given) -> List[Section]:
    """Return the residuals: a table, and plots of each sensor."""
    if given.calibration is None:
        return []
    blocks: List[Block] = [_residual_table(given.calibration)]
    if not given.residuals:
        blocks.append(Text(_NO_RESIDUALS, warns=True))
    for name in given.sensors:
        charts_of_one = sensor_charts(name, of_sensor(given.residuals, name), _camera(given, name))
        blocks += galleries(name, list(charts_of_one))
    return [Section("residuals", "How well measurements fit", blocks)]


def _residual_table(document: Document) -> Table:
    rows = []
    for name, sensor in document["sensors"].items():
        for kind, statistics in sensor["residuals"].items():
            unit = statistics["unit"]
            expected = sensor["sigma"].get(f"{kind}_{unit}")
            sigma = ABSENT if expected is None else _with_equal_digits(expected, unit)
            counts = [str(sensor["detections"]), str(statistics["count"])]
            keys = ("mean", "rms", "median", "max")
            numbers = [_with_equal_digits(statistics[key], unit) for key in keys]
            shown_unit = millimetres(0.0, unit)[1]
            rows.append([name, _SHORT[kind], *counts, *numbers, sigma, shown_unit])
    columns = ["sensor", "of", "boards", "number", "mean", "RMS", "median", "largest"]
    columns += ["sigma", "unit"]
    note = "Sigma: the standard deviation of one measurement as the solver estimated it (median)."
    return Table("Residuals at the solution, by sensor", columns, rows, note=note)


def _with_equal_digits(value: float, unit: str) -> str:
    """Return a number of a column that is compared down: mm to a hundredth, px to a thousandth."""
    return f"{millimetres(value, unit)[0]:.{2 if unit == 'm' else 3}f}"


def _camera(given: Given, name: str) -> Optional[Camera]:
    if given.dataset is None or name not in given.dataset.sensors:
        return None
    return given.dataset.sensors[name].camera


def sensor_charts(
    name: str, samples: Sequence[ResidualSample], camera: Optional[Camera]
) -> List[Chart]:
    """Return the plots of one sensor's residuals.

    Args:
        name: of the sensor.
        samples: its residuals, kind by kind.
        camera: where it has an image.
    """
    found: List[Chart] = []
    for sample in samples:
        residual, unit = sample.residual.astype(float), sample.unit
        if unit == "m":
            residual, unit = 1e3 * residual, "mm"
        words = _WORDS[sample.kind]
        found.append(_histogram(name, sample, residual, unit))
        if sample.kind == REPROJECTION:
            alt = f"{name}: errors in x and y of {len(residual)} corners, about zero"
            draw = partial(charts.draw_scatter, residual_px=residual)
            title = f"{name}: {words}, x and y; circles at 1, 2 and 3 fitted sigmas"
            found.append(Chart(title, alt, draw, dense=True))
        pixels = _pixels(sample, camera)
        if pixels is not None and camera is not None and sample.kind != BORDER:
            size = (float(camera.width), float(camera.height))
            draw = partial(
                charts.draw_image_plane, places=pixels, residual=residual, size=size, unit=unit
            )
            alt = f"{name}: RMS of residuals by part of the image, with mean errors as arrows"
            longest = charts.longest_mean(pixels, residual, size)
            arrows = f"; longest arrow, a mean error: {longest:.2g} {unit}" if longest else ""
            found.append(Chart(f"{name}: {words}, RMS over the image{arrows}", alt, draw))
        if sample.kind == ORTHOGONAL:
            found += _along(name, sample, residual[:, 0], unit)
    return found


def _histogram(name: str, sample: ResidualSample, residual: np.ndarray, unit: str) -> Chart:
    sigma = charts.fitted_sigma(np.ravel(residual))
    alt = (
        f"{name}: histogram of residuals of {_WORDS[sample.kind]}, fitted sigma {sigma:.3g} {unit}"
    )
    what = "x and y error" if sample.kind == REPROJECTION else "residual"
    draw = partial(charts.draw_histogram, values=np.ravel(residual), unit=unit, what=what)
    beyond = int(np.sum(np.abs(residual) > 5.0 * sigma))
    title = f"{name}: {_WORDS[sample.kind]}; fitted sigma {sigma:.3g} {unit}"
    title += f"; beyond 5 sigmas: {beyond} of {residual.size}"
    return Chart(title, alt, draw)


def _along(name: str, sample: ResidualSample, residual: np.ndarray, unit: str) -> List[Chart]:
    distance = np.linalg.norm(sample.seen.astype(float), axis=1)
    incidence = np.degrees(sample.incidence_rad.astype(float))
    found = []
    for along, label, words in (
        (distance, "distance [m]", "by distance"),
        (incidence, "incidence [deg]", "by incidence"),
    ):
        draw = partial(charts.draw_along, along=along, residual=residual, label=label, unit=unit)
        alt = f"{name}: residuals of points {words}, with median and quartiles"
        title = f"{name}: points, {words}; line: median, band: middle half"
        found.append(Chart(title, alt, draw, dense=True))
    return found


def _pixels(sample: ResidualSample, camera: Optional[Camera]) -> Optional[np.ndarray]:
    """Return where residuals were seen in the image (n, 2) [px]; None where there is none."""
    seen = sample.seen.astype(float)
    if seen.shape[1] == 2:
        return seen
    return None if camera is None else camera.project(seen)


# ---- detections and coverage


def detections_section(given: Given) -> List[Section]:
    """Return who saw a board when, and what was left out of it."""
    document = given.calibration
    if document is None:
        return []
    names = list(document["sensors"])
    rejected: Dict[Tuple[str, str], List[str]] = {}
    for r in document["rejected_detections"]:
        told = f"left out: {r['reason']}" if _has_one_board(given) else _of_board(r)
        rejected.setdefault((r["collection"], r["sensor"]), []).append(told)
    labeled = _labeled(given)
    rows: List[List[Union[str, Cell]]] = []
    for key, collection in list(document["collections"].items())[:_MOST_ROWS]:
        residuals = collection["residuals"]
        cells = [
            _detection(residuals.get(n), rejected.get((key, n), []), (key, n) in labeled)
            for n in names
        ]
        rows.append([key, *cells])
    total = len(document["collections"])
    note = (
        "Numbers: corners or points that were used. x: left out, since it contradicts the rest; "
        "with a number, one board of several. o: seen, and not used."
    )
    if total > _MOST_ROWS:
        note += f" The first {_MOST_ROWS} of {total} collections are shown."
    unused = [
        f"collection {key} is not used: {value['reason']}"
        for key, value in document["collections"].items()
        if value["reason"]
    ]
    table = Table("Boards that each sensor saw", ["collection", *names], rows, True, note)
    if len(unused) > _MOST_UNUSED:
        more = len(unused) - _MOST_UNUSED
        unused = [*unused[:_MOST_UNUSED], f"and {more} more (calibration.json, collections)"]
    return [Section("detections", "Who saw the board when", [table, *map(Text, unused)])]


def _has_one_board(given: Given) -> bool:
    return given.dataset is None or len(given.dataset.patterns) < 2


def _of_board(rejected: Mapping[str, Any]) -> str:
    return f"board '{rejected['pattern']}' is left out: {rejected['reason']}"


def _labeled(given: Given) -> Set[Tuple[str, str]]:
    """Return collection and sensor of each label, as far as the dataset can be read."""
    if given.dataset is None:
        return set()
    return {(key.collection, key.sensor) for key, _ in given.dataset.detections()}


def _detection(
    residuals: Optional[Mapping[str, Any]], rejected: Sequence[str], is_labeled: bool
) -> Cell:
    if not residuals:
        if rejected:
            return Cell("x", "wrong", "; ".join(rejected))
        return Cell("o", "none", "seen, and not used") if is_labeled else _NOT_SEEN
    count = sum(s["count"] for kind, s in residuals.items() if kind != BORDER)
    told = "; ".join(
        f"{_SHORT[kind]} {millimetres(s['mean'], s['unit'])[0]:.2f} "
        f"{millimetres(0.0, s['unit'])[1]} in the mean"
        for kind, s in residuals.items()
    )
    if rejected:
        return Cell(f"{count} x", "wrong", "; ".join([*rejected, told]))
    return Cell(str(count), "seen", told)


def coverage_section(
    given: Given, seen: Mapping[str, Sequence[Sighting]], guidance: Mapping[str, Guidance]
) -> List[Section]:
    """Return where in its view, how far and how tilted each sensor saw boards."""
    blocks: List[Block] = []
    for name in given.sensors:
        sighted = seen.get(name, ())
        items: List[Union[Chart, Picture]] = []
        view = _coverage(given, name)
        if view is not None:
            items.append(view)
        if sighted:
            distance = np.array([s.distance_m for s in sighted])
            tilt = np.array([s.tilt_deg for s in sighted])
            draw = partial(charts.draw_tilts, distance_m=distance, tilt_deg=tilt)
            alt = (
                f"{name}: {len(sighted)} boards, {distance.min():.2f} to {distance.max():.2f} m "
                f"away, tilted {tilt.min():.0f} to {tilt.max():.0f} deg"
            )
            title = f"{name}: distance and tilt of its boards; tilt 0 faces the sensor"
            items.append(Chart(title, alt, draw))
        told = f" ({guidance[name].sentence})" if name in guidance else ""
        blocks += galleries(f"{name}{told}", items, wide=True)
    if not blocks:
        return []
    return [Section("coverage", "How well each view is covered", blocks)]


def _coverage(given: Given, name: str) -> Optional[Chart]:
    samples = [s for s in of_sensor(given.residuals, name) if s.kind != BORDER]
    if not samples:
        return None
    camera, sample = _camera(given, name), samples[0]
    pixels = _pixels(sample, camera)
    if pixels is not None and camera is not None:
        size = (float(camera.width), float(camera.height))
        draw = partial(charts.draw_coverage, pixels=pixels, size=size)
        title = f"{name}: where boards were seen; lines: thirds of the image"
        return Chart(title, f"{name}: labels in the image", draw, True)
    if sample.seen.shape[1] != 3:
        return None
    draw = partial(charts.draw_directions, points=sample.seen.astype(float))
    title = f"{name}: where boards were seen; azimuth 0 is the sensor's x axis"
    return Chart(title, f"{name}: directions of labels", draw, True)


# ---- certainty


def certainty_section(given: Given) -> List[Section]:
    """Return what is known how well: weak directions, and points carried between sensors."""
    document = given.calibration
    if document is None:
        return []
    blocks: List[Block] = [
        Text(
            f"Not determined: {', '.join(weak['parameters'])} "
            f"({sigma_in_words(weak['sigma'], weak['unit'])}): {weak['why']}",
            warns=True,
        )
        for weak in document["weak_directions"]
    ]
    blocks += [
        Text(
            f"Held by the prior of {', '.join(held['priors'])}: {', '.join(held['parameters'])} "
            f"(sigma {held['sigma']:.3g} {held['unit']}): {held['why']}"
        )
        for held in document.get("held_by_prior", ())
    ]
    shown = shown_errors(document.get("model_errors", ()))
    shown += [edge["why"] for edge in document.get("moving_edges", ()) if "why" in edge]
    blocks += [Text(f"The data show: {told}", warns=True) for told in shown]
    if document.get("propagation"):
        blocks += _propagation(document["propagation"])
    return [Section("certainty", "How sure it is", blocks)] if blocks else []


def _propagation(pairs: Sequence[Mapping[str, Any]]) -> List[Block]:
    """Return how far off points are that are carried from one sensor to another, as matrices."""
    names = list(dict.fromkeys(pair["source"] for pair in pairs))
    own: Dict[Tuple[str, str], str] = {}
    image: Dict[Tuple[str, str], str] = {}
    for pair in pairs:
        where = pair["source"], pair["target"]
        point = min(pair["points"], key=lambda p: abs(p["distance_m"] - _CARRIED_M))
        metres = point.get("combined_sigma_m", point["sigma_m"])
        own[where] = "open" if is_open(metres, "m") else f"{1e3 * metres:.1f}"
        pixels = point.get("combined_sigma_px", point["sigma_px"])
        if pixels is not None:
            image[where] = "open" if is_open(metres, "m") else f"{pixels:.1f}"
    note = (
        f"A point that the sensor of the row sees {_CARRIED_M:g} m away, told to the sensor of the "
        "column: how far off it may be there, one standard deviation, with the usual errors of "
        "sensors and boards where they are known."
    )
    seeing = [name for name in names if any(target == name for _, target in image)]
    blocks: List[Block] = []
    for unit, values, columns in (("mm", own, names), ("px", image, seeing)):
        rows = [[n, *(values.get((n, other), "·") for other in columns)] for n in names]
        caption = f"Points carried from one sensor to another [{unit}]"
        if columns:
            blocks.append(Table(caption, ["from / to", *columns], rows, matrix=True, note=note))
    return blocks


def outliers_section(given: Given) -> List[Section]:
    """Return the single corners and points that lie farthest off."""
    document = given.calibration
    if document is None:
        return []
    counts = [
        [name, str(sensor["outliers"]), _share(sensor)]
        for name, sensor in document["sensors"].items()
    ]
    limit = document["outlier_limit_sigmas"]
    table = Table(f"Beyond {limit:g} sigmas", ["sensor", "number", "share"], counts)
    rows = []
    for o in document["outliers"][:_MOST_OUTLIERS]:
        value, unit = millimetres(o["residual"], o["unit"])
        figures = [f"{value:.3g} {unit}", f"{o['sigmas']:.1f}"]
        rows.append([o["sensor"], o["collection"], _SHORT[o["kind"]], str(o["id"]), *figures])
    columns = ["sensor", "collection", "of", "number", "residual", "sigmas"]
    blocks: List[Block] = [table]
    if rows:
        blocks.append(Folded(f"The {len(rows)} largest", [Table("The largest", columns, rows)]))
    return [Section("outliers", "Outliers", blocks)]


def _share(sensor: Mapping[str, Any]) -> str:
    items = sum(statistics["count"] for statistics in sensor["residuals"].values())
    return f"{100.0 * sensor['outliers'] / max(items, 1):.2f} %"


# ---- how it was made


def making_section(given: Given) -> List[Section]:
    """Return warnings, options, versions and checksums of the results."""
    blocks: List[Block] = [Text(remark, warns=True) for remark in given.remarks]
    for title, document in (("calibrate", given.calibration), ("evaluate", given.evaluation)):
        if document is None:
            continue
        if document is given.calibration:  # those of an evaluation stand beside its figures
            blocks += [Text(warning, warns=True) for warning in document.get("warnings", [])]
        blocks += _versions(title, document)
        options = document.get("options", {})
        rows = [[name, _plain(value)] for name, value in options.items() if value not in (None, [])]
        table = Table(f"Options of {title}", ["option", "value"], rows, words=True)
        blocks.append(Folded(f"Options of {title}", [table]))
    if given.calibration is not None:
        blocks.append(_solver(given.calibration))
    return [Section("making", "How it was made", blocks)]


def _versions(title: str, document: Document) -> List[Block]:
    found: List[Block] = []
    if document.get("inputs"):
        rows = [[e["what"], str(e["path"]), str(e["sha256"])] for e in document["inputs"]]
        found.append(Table(f"Inputs of {title}", ["what", "file", "SHA-256"], rows, words=True))
    if document.get("versions"):
        pairs = [[name, str(value)] for name, value in document["versions"].items()]
        found.append(Table(f"Versions of {title}", ["program", "version"], pairs, words=True))
    return found


def _solver(document: Document) -> Table:
    solver = document["solver"]
    seconds = solver["seconds"]
    rows = [
        ["solver", f"{solver['name']}, {solver['iterations']} iterations"],
        ["residuals, parameters", f"{solver['residuals']}, {solver['parameters']}"],
        [
            "time",
            f"{seconds.get('total', math.nan):.2f} s, of which {seconds['solve']:.2f} s solve",
        ],
    ]
    return Table("Solver", ["", "value"], rows, words=True)


def _plain(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return " ".join(map(str, value))
    return str(value)
