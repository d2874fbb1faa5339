"""The report of a result: what it holds, in the order of reading."""

from __future__ import annotations

from functools import partial
from typing import Dict, List, Mapping, Optional

import numpy as np

from atom_core.labeling.guidance import Guidance
from atom_core.report.page import charts
from atom_core.report.page.blocks import Chart, Page, Section, Viewer
from atom_core.report.page.calibration_sections import (
    certainty_section,
    coverage_section,
    detections_section,
    making_section,
    outliers_section,
    residuals_section,
)
from atom_core.report.page.data_sections import clouds_section, labels_section, worst_section
from atom_core.report.page.evaluation_sections import pairs_section, truth_section
from atom_core.report.page.given import Given
from atom_core.report.page.moves import moves_section
from atom_core.report.page.overview import facts, sensor_lines, sentences
from atom_core.report.page.scene import decoded, rig_scene
from atom_core.report.page.trust_sections import changes_section, trust_section
from atom_core.report.page.views import Sighting, guidance_of, sightings


def make_page(given: Given) -> Page:
    """Return the report of results.

    Args:
        given: the results and what belongs to them.
    """
    seen: Dict[str, List[Sighting]] = {} if given.dataset is None else sightings(given.dataset)
    lacks = _guidance(given, seen)
    grade, sentence, also = sentences(given)
    words = [
        word
        for word, document in (("calibration", given.calibration), ("evaluation", given.evaluation))
        if document is not None
    ]
    return Page(
        title=f"Report of the {' and the '.join(words)}",
        grade=grade,
        sentence=sentence,
        also=also,
        sensors=sensor_lines(given, lacks),
        viewer=_viewer(given, seen),
        sections=_sections(given, seen, lacks),
        facts=facts(given),
    )


def _sections(
    given: Given, seen: Dict[str, List[Sighting]], lacks: Mapping[str, Guidance]
) -> List[Section]:
    return [
        *moves_section(given),
        *residuals_section(given),
        *detections_section(given),
        *coverage_section(given, seen, lacks),
        *worst_section(given, seen),
        *clouds_section(given, seen),
        *pairs_section(given),
        *truth_section(given),
        *changes_section(given),
        *certainty_section(given),
        *trust_section(given),
        *outliers_section(given),
        *labels_section(given, seen),
        *making_section(given),
    ]


def _guidance(given: Given, seen: Mapping[str, List[Sighting]]) -> Dict[str, Guidance]:
    if given.dataset is None:
        return {}
    found: Dict[str, Guidance] = {}
    for name, sensor in given.dataset.sensors.items():
        lacks = guidance_of(sensor, seen.get(name, []), given.residuals)
        if lacks is not None:
            found[name] = lacks
    return found


def _viewer(given: Given, seen: Dict[str, List[Sighting]]) -> Optional[Viewer]:
    if given.dataset is None or not given.dataset.collections:
        return None
    scene = rig_scene(given, seen)
    first = scene["points"].get(scene["collections"][0], {}) if scene["collections"] else {}
    points: List[np.ndarray] = [decoded(text, scene["unit_m"]) for text in first.values()]
    draw = partial(charts.draw_scene, scene=scene, points=points)
    alt = (
        f"The rig: {len(scene['sensors'])} sensors before (dotted) and after, and "
        f"{len(scene['boards'])} boards"
    )
    return Viewer(scene, Chart("The rig", alt, draw, dense=True, solid=True))
