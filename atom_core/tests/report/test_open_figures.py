"""What the data do not determine is said in words, without figures that tell nothing."""

import re

import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.report import verdict as limits
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_tables import calibration_report
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.synthetic import degenerate


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (degenerate.redundant_edge, "neither its place nor its direction is determined"),
        (degenerate.planar_motion, "its place is not determined, its direction known to 0."),
    ],
)
def test_what_is_not_determined_is_called_that_without_a_figure(make, told):
    """ "known to 5706 m and 117347 deg only" told nobody anything."""
    results = calibration_results(calibrate(make(0).dataset), "any")
    assert told in calibration_verdict(results).sensors["rgb_2"].sentence
    report = calibration_report(results)
    assert "open: not determined" in " ".join(report.split())
    assert "sigma beyond 10 m" in report and not re.search(r"\d{5,}\.\d", report)


def test_how_well_something_is_known_is_told_of_each_part():
    known = [limits.known_to(m, rad) for m in (0.02, 11.0) for rad in (0.01, 2.0)]
    assert known == [
        "known to 20 mm and 0.57 deg only",
        "its direction is not determined, its place known to 20 mm",
        "its place is not determined, its direction known to 0.57 deg",
        "neither its place nor its direction is determined",
    ]
    assert limits.sigma_in_words(0.25, "m") == "sigma 0.25 m"
    assert limits.sigma_in_words(2.0, "rad") == "sigma beyond 1.6 rad"
    assert limits.sigma_in_words(1e6, "px") == "sigma 1e+06 px"
