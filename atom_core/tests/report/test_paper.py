"""Sheets of paper: nothing is lost, nothing lies beyond the margins or on something else."""

import numpy as np
import pytest
from matplotlib.backends.backend_pdf import RendererPdf

from atom_core.report.page.blocks import Chart, Page, Picture, Section, SensorLine
from atom_core.report.page.paper import BOTTOM, LEFT, TOP, Paper
from atom_core.report.page.pdf import cover, pdf


def chart(names=("a", "b")):
    def draw(axes):
        axes.barh(range(len(names)), range(1, len(names) + 1))
        axes.set_yticks(range(len(names)))
        axes.set_yticklabels(names)
        axes.set_xlabel("[mm]")

    return Chart("bars", "bars", draw)


def picture(width, height):
    return Picture("picture", "picture", np.zeros((height, width, 3), np.uint8))


def lines_of(paper):
    """Return all lines that stand on the sheets, in their order."""
    return [
        line
        for sheet in paper.sheets
        for text in sheet.texts
        for line in text.get_text().split("\n")
    ]


def boxes_of(sheet):
    """Return what texts and axes cover of a sheet, as (x0, y0, x1, y1) in parts of it."""
    renderer = sheet.canvas.get_renderer()
    drawn = [text.get_window_extent(renderer) for text in sheet.texts]
    drawn += [axes.get_tightbbox(renderer) for axes in sheet.axes]
    return np.array([box.transformed(sheet.transFigure.inverted()).extents for box in drawn])


def overlap(one, other):
    low, high = np.maximum(one[:2], other[:2]), np.minimum(one[2:], other[2:])
    return float(np.prod(np.clip(high - low, 0.0, None)))


CONTENTS = {
    "short": ([["one line"]], []),
    "a long paragraph": ([[f"line {i}" for i in range(200)]], []),
    "many paragraphs": ([[f"{k}: line {i}" for i in range(9)] for k in range(30)], []),
    "figures": ([["words"]], [chart(), picture(400, 300), chart(), chart(), picture(300, 400)]),
    "figures alone": ([], [chart() for _ in range(11)]),
    "wide pictures": ([["words"]], [picture(900, 200), chart(), picture(900, 100), chart()]),
    "long names": ([], [chart(("a sensor of a long name - another of a long name", "b")), chart()]),
}


@pytest.mark.parametrize("name", CONTENTS)
def test_all_is_there_and_apart(name):
    paragraphs, items = CONTENTS[name]
    paper = Paper()
    for title in ("first", "second"):
        paper.section(title, [line for p in paragraphs for line in [*p, ""]], items)
    wanted = [line for paragraph in paragraphs for line in paragraph]
    assert lines_of(paper) == ["first", *wanted, "second", *wanted]
    assert sum(len(sheet.axes) for sheet in paper.sheets) == 2 * len(items)
    for sheet in paper.sheets:
        boxes = boxes_of(sheet)
        assert np.all(boxes[:, 0] >= LEFT - 0.01) and np.all(boxes[:, 2] <= 1.0)
        assert np.all(boxes[:, 1] >= BOTTOM - 0.01) and np.all(boxes[:, 3] <= TOP + 0.01)
        for i, box in enumerate(boxes):
            assert all(overlap(box, other) < 1e-4 for other in boxes[:i])


def test_short_sections_share_a_sheet_and_a_heading_is_never_alone():
    paper = Paper()
    for i in range(12):
        paper.section(f"section {i}", [f"line {i}"], [])
    assert len(paper.sheets) == 1
    paper = Paper()
    paper.section("first", [f"line {i}" for i in range(88)], [])
    paper.section("second", [f"line {i}" for i in range(20)], [])
    assert [sheet.texts[0].get_text() for sheet in paper.sheets] == ["first", "second"]


def test_what_follows_an_ended_sheet_is_on_the_next():
    paper = Paper()
    paper.new_sheet()
    paper.end_sheet()
    paper.section("first", ["line"], [])
    assert [len(sheet.texts) for sheet in paper.sheets] == [0, 2]


def test_the_first_sheets_hold_every_sensor_however_many_there_are():
    names = [f"rgb_{i}" for i in range(60)]
    lines = [SensorLine(n, "rgb", "weak", "weak", "known to 15 mm", f"tilt {n}") for n in names]
    page = Page("Report", "weak", "rgb_1 is weak", "", lines, None, (), [("status", "converged")])
    paper = Paper()
    cover(paper, page)
    written = "\n".join(lines_of(paper))
    assert all(f"{n} (rgb): WEAK" in written and f"tilt {n}" in written for n in names)
    for sheet in paper.sheets:
        assert np.all(boxes_of(sheet) >= BOTTOM - 0.01) and np.all(boxes_of(sheet) <= 1.0)


def test_dollars_in_a_path_are_no_formula():
    paper, path = Paper(), "/data/$\\nowhere$/train.json"
    cover(paper, Page("Report", "good", path, "", (), None, (), [("calibrated from", path)]))
    paper.section(path, [path], [chart(), Chart(path, path, lambda axes: None)])
    for sheet in paper.sheets:
        sheet.canvas.draw()  # an unknown word of a formula ends it with an error


def test_sheets_that_are_full_are_handed_on_and_one_is_in_memory():
    contents = [[f"line {i}" for i in range(300)], [f"other {i}" for i in range(200)]]
    kept, full = Paper(), []
    paper = Paper(full.append)
    for lines in contents:
        kept.section("title", lines, [chart()])
        paper.section("title", lines, [chart()])
        assert len(paper.sheets) == 1
    texts = [[text.get_text() for text in sheet.texts] for sheet in [*full, *paper.sheets]]
    assert texts == [[text.get_text() for text in sheet.texts] for sheet in kept.sheets]
    assert len(full) > 3


def test_a_pdf_keeps_of_an_image_what_it_shows_and_no_whole_sheet(monkeypatch):
    given = []

    def draw_image(self, gc, x, y, im, *more):
        given.append(im)

    monkeypatch.setattr(RendererPdf, "draw_image", draw_image)
    dense = Chart("dots", "dots", lambda axes: axes.scatter([1, 2], [1, 2]), dense=True)
    section = Section("dots", "Dots", [dense, dense])
    pdf(Page("Report", "good", "good", "", (), None, [section], [("status", "converged")]))
    assert len(given) == 2 and all(im.base is None for im in given)
    assert RendererPdf.draw_image is draw_image
