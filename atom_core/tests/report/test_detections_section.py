"""Who saw the board when: what was used, what was left out, and what was seen and not used."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.report.page.calibration_sections import detections_section, sensor_charts
from atom_core.report.page.given import Given
from atom_core.report.residual_samples import residual_samples
from atom_core.synthetic.scenes import two_patterns

SPOILT = "004"


@pytest.fixture(scope="module")
def calibration():
    """Two boards, of which one was moved between the exposures of a collection."""
    dataset = two_patterns(3, collections=14).dataset
    label = dataset.collections[SPOILT].labels["rgb_2", "left"]
    moved = replace(label, pixels=label.pixels + np.array([25.0, -12.0]))
    return calibrate(dataset.with_labels(SPOILT, {("rgb_2", "left"): moved}))


@pytest.fixture(scope="module")
def document(calibration):
    found = calibration_document(calibration_results(calibration, "test"), {})
    return json.loads(json.dumps(found))


def cells_of(given, key):
    (section,) = detections_section(given)
    names = section.blocks[0].columns[1:]
    (row,) = [row for row in section.blocks[0].rows if row[0] == key]
    return dict(zip(names, row[1:])), section


def test_a_board_that_is_used_stands_beside_one_of_the_same_sensor_that_is_not(
    calibration, document
):
    cells, _ = cells_of(Given(document, None, calibration.dataset), SPOILT)
    used = document["collections"][SPOILT]["residuals"]["rgb_2"]["reprojection"]["count"]
    assert (cells["rgb_2"].text, cells["rgb_2"].mark) == (f"{used} x", "wrong")
    assert cells["rgb_2"].title.startswith("board 'left' is left out: ")
    assert cells["rgb_1"].text == "x"  # it sees that board alone
    assert cells["depth_1"].mark == "seen" and "left out" not in cells["depth_1"].title


def test_what_was_seen_and_not_used_is_not_called_unseen(calibration, document):
    unused = {"used": False, "reason": "no detection can place the board", "residuals": {}}
    changed = {**document, "collections": {**document["collections"], "000": unused}}
    changed["rejected_detections"] = []
    cells, section = cells_of(Given(changed, None, calibration.dataset), "000")
    labeled = {sensor for sensor, _ in calibration.dataset.collections["000"].labels}
    assert labeled
    for name, cell in cells.items():
        seen = ("o", "seen, and not used") if name in labeled else ("·", "not seen")
        assert (cell.text, cell.title) == seen
    assert section.blocks[1].text.startswith("collection 000 is not used: ")


def test_collections_that_are_not_used_are_named_or_counted(document):
    unused = {"used": False, "reason": "nothing is seen", "residuals": {}}
    many = {**document, "collections": {f"{i:03d}": unused for i in range(100)}}
    (section,) = detections_section(Given(many, None))
    assert len(section.blocks) == 32 and section.blocks[-1].text.startswith("and 70 more")


def test_residuals_beyond_five_sigmas_are_counted_of_those_that_are_drawn(calibration):
    sample = next(s for s in residual_samples(calibration, most=200) if s.kind == "border")
    (chart, *_) = sensor_charts(sample.sensor, [sample], None)
    assert chart.title.endswith(" of 200") and "beyond 5 sigmas: " in chart.title
