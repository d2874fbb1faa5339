"""The report shows the numbers of the result: charts, pictures and the rig, from known scenes."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.geometry import se3
from atom_core.labeling.guidance import Guidance
from atom_core.model.transforms import Edge
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.report.page import charts, html, pictures
from atom_core.report.page.blocks import SensorLine
from atom_core.report.page.data_sections import worst_collections
from atom_core.report.page.given import Given
from atom_core.report.page.make import make_page
from atom_core.report.page.moves import moved
from atom_core.report.page.overview import sensor_lines, sentences
from atom_core.report.page.pdf import pdf
from atom_core.report.page.scene import decoded, rig_scene
from atom_core.report.page.views import sightings
from atom_core.report.residual_samples import from_bytes, residual_samples, to_bytes
from atom_core.synthetic import scenes

MOVED_M, TURNED_RAD = 0.05, 0.03
STATIC = Path(html.__file__).parent / "static"


@pytest.fixture(scope="module")
def calibration():
    scene = scenes.random_scene(1, collections=6, disturbance=(MOVED_M, TURNED_RAD))
    return calibrate(scene.dataset)


@pytest.fixture(scope="module")
def given(calibration):
    document = calibration_document(calibration_results(calibration, "test"), {})
    document = json.loads(json.dumps(document))
    return Given(document, None, calibration.dataset, residual_samples(calibration))


@pytest.fixture(scope="module")
def page(given):
    return make_page(given)


@pytest.fixture(scope="module")
def text(page):
    return html.html(page)


# ---- numbers


def test_all_residuals_are_kept_where_they_are_few_and_thinned_out_where_they_are_many(
    calibration, given
):
    for sample in residual_samples(calibration, most=10**6):
        statistics = given.calibration["sensors"][sample.sensor]["residuals"][sample.kind]
        norms = np.linalg.norm(sample.residual, axis=1)
        assert sample.count == len(norms) == statistics["count"]
        assert np.sqrt(np.mean(norms**2)) == pytest.approx(statistics["rms"], rel=1e-4)
    for sample in residual_samples(calibration, most=50):
        assert len(sample.residual) == min(50, sample.count)


def test_residuals_go_to_a_file_and_back(given):
    back = from_bytes(to_bytes(given.residuals))
    for one, other in zip(given.residuals, back):
        assert (one.sensor, one.kind, one.count) == (other.sensor, other.kind, other.count)
        assert np.array_equal(one.residual, other.residual)
        assert np.array_equal(one.collection, other.collection)
    with pytest.raises(ValueError, match="holds no residuals"):
        from_bytes(b"PK nothing of that kind")


def test_incidence_is_what_the_poses_say(calibration, given):
    """The median incidence of a sensor's points is about the median tilt of its boards."""
    seen = sightings(calibration.dataset)
    for sample in given.residuals:
        tilts = {s.key.collection: s.tilt_deg for s in seen[sample.sensor]}
        for key, tilt_deg in tilts.items():
            own = np.degrees(sample.incidence_rad[sample.collection == key])
            if len(own):
                assert np.median(own) == pytest.approx(tilt_deg, abs=15.0)


def test_sigma_is_fitted_to_the_many_and_not_to_outliers():
    values = 0.3 * np.random.default_rng(0).standard_normal(20000)
    values[:200] = 50.0
    assert charts.fitted_sigma(values) == pytest.approx(0.3, rel=0.03)


def test_means_of_cells_are_those_of_what_lies_in_them():
    places = np.array([[10.0, 10.0]] * 5 + [[630.0, 470.0]] * 5 + [[320.0, 10.0]])
    values = np.array([[1.0]] * 5 + [[3.0]] * 5 + [[9.0]])
    _, means, counts = charts.cell_means(places, values, (640.0, 480.0))
    assert means.shape == (6, 8, 1) and counts.sum() == len(places)
    assert means[0, 0, 0] == 1.0 and means[5, 7, 0] == 3.0
    assert np.sum(np.isfinite(means)) == 2  # one alone is no mean


def test_edges_moved_by_what_they_were_disturbed_by(given):
    """The start is off by a known move, and the solution is true but for millimetres."""
    held = {
        Edge(e["parent"], e["child"]) for e in given.calibration["edges"].values() if e["anchored"]
    }
    for edge, (distance_mm, turned_deg) in moved(given.calibration).items():
        if edge in held:
            assert (distance_mm, turned_deg) == pytest.approx((0.0, 0.0), abs=1e-9)  # rounding
        else:
            assert distance_mm == pytest.approx(1e3 * MOVED_M, abs=15.0)
            assert turned_deg == pytest.approx(np.degrees(TURNED_RAD), abs=0.4)


def test_the_collection_that_was_spoilt_is_the_worst(given):
    document = json.loads(json.dumps(given.calibration))
    key = list(document["collections"])[2]
    camera = next(n for n, s in document["sensors"].items() if s["modality"] == "rgb")
    document["collections"][key]["residuals"][camera] = {
        "reprojection": {"unit": "px", "count": 40, "mean": 9.0, "rms": 9.9, "median": 9, "max": 20}
    }
    worst = worst_collections(document)
    assert worst[0][:2] == (key, camera) and len(worst) <= 5
    usual = document["sensors"][camera]["residuals"]["reprojection"]["rms"]
    assert worst[0][2] == pytest.approx(9.9 / usual)


# ---- the rig


def test_the_scene_has_sensors_where_they_are_and_boards_where_sensors_saw_them(given):
    dataset, seen = given.dataset, sightings(given.dataset)
    scene = rig_scene(given, seen)
    first = next(iter(dataset.collections))
    assert [sensor["name"] for sensor in scene["sensors"]] == list(dataset.sensors)
    assert all(sensor["before"] and sensor["after"] for sensor in scene["sensors"])
    assert len(scene["boards"]) == len(dataset.collections)
    boards = {board["collection"]: np.array(board["corners"]) for board in scene["boards"]}
    for texts in [scene["points"][first]]:
        for name, text in texts.items():
            label_seen = [s for s in seen[name] if s.key.collection == first]
            if label_seen:  # points of this sensor lie on the board
                corners, points = boards[first], decoded(text, scene["unit_m"])
                normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
                heights = (points - corners[0]) @ normal / np.linalg.norm(normal)
                near = np.linalg.norm(points - corners.mean(axis=0), axis=1) < 0.25
                assert not near.any() or np.median(np.abs(heights[near])) < 0.02


def test_ellipsoids_are_standard_deviations_so_many_times(given):
    scene = rig_scene(given, sightings(given.dataset))
    edges = given.calibration["edges"].values()
    for sensor in scene["sensors"]:
        edge = next(e for e in edges if sensor["name"] in e["sensors"])
        if edge["anchored"]:
            assert sensor["ellipsoid"] is None
            continue
        lengths = np.linalg.norm(sensor["ellipsoid"]["axes"], axis=1)
        sigmas = np.array(edge["combined_sigma_translation_m"])
        assert lengths == pytest.approx(scene["magnification"] * sigmas, abs=2e-4)


def carried(given, places):
    """Return results whose rig and boards stand elsewhere in the world, by collection (3,) [m]."""
    dataset, edges = given.dataset, {}
    for place, (key, collection) in zip(places, given.dataset.collections.items()):
        there = se3.transform(np.eye(3), np.array(place))
        roots = {e: m for e, m in collection.transforms.items() if e.parent == dataset.world}
        edges[key] = {edge: there @ matrix for edge, matrix in roots.items()}
    return Given(given.calibration, None, dataset.with_transforms(edges), ())


@pytest.mark.parametrize("far", [(300.0, -200.0, 0.0), (5e5, 4e6, 100.0)])
def test_a_rig_far_from_the_worlds_origin_is_drawn_as_one_beside_it(given, far):
    """As in a map: with its points, and where the world's origin is at the axes."""
    moved = carried(given, [far] * len(given.dataset.collections))
    near, scene = (rig_scene(one, sightings(one.dataset)) for one in (given, moved))
    for at, title in zip(far, scene["axes"]):
        sign, number = re.fullmatch(r"[xyz](?: ([-+]) (\d+))? \[m\]", title).groups()
        assert float(number or 0.0) * (1 if sign == "-" else -1) == pytest.approx(at, abs=5.0)
    gap = np.subtract(near["boards"][0]["corners"][0], scene["boards"][0]["corners"][0])
    assert np.allclose(gap, np.rint(gap), atol=2e-4)
    for one, other in zip(near["sensors"], scene["sensors"]):
        assert np.allclose(np.subtract(one["place"], other["place"]), gap, atol=2e-4)
    for key, texts in near["points"].items():
        for name, text in texts.items():
            points = decoded(text, near["unit_m"]) - gap
            drawn = decoded(scene["points"][key][name], scene["unit_m"])
            assert len(drawn) == len(points) and np.allclose(points, drawn, atol=0.0021)


def test_points_of_a_rig_that_is_hundreds_of_metres_wide_are_kept(given):
    places = [(60.0 * i, 0.0, 0.0) for i in range(len(given.dataset.collections))]
    driven = carried(given, places)
    near, scene = (rig_scene(one, sightings(one.dataset)) for one in (given, driven))
    for key, texts in near["points"].items():
        for name, text in texts.items():
            assert len(text) == len(scene["points"][key][name])


# ---- pictures


def test_points_of_a_cloud_are_drawn_at_their_pixels_and_near_ones_over_far_ones():
    image = np.full((100, 200, 3), 128, dtype=np.uint8)
    pixels = np.array([[50.0, 20.0], [150.0, 80.0], [150.0, 80.0]])
    drawn = pictures.with_cloud(image, pixels, np.array([1.0, 1.0, 5.0]), (1.0, 5.0))
    assert np.array_equal(drawn[20, 50], drawn[80, 150])  # the near one covers the far one
    assert np.ptp(drawn[20, 50].astype(int)) > 50 and np.ptp(drawn[50, 100].astype(int)) == 0


def test_the_part_around_a_board_holds_it_whole():
    image = np.zeros((480, 640, 3), dtype=np.uint8)
    found = np.array([[100.0, 100.0], [300.0, 100.0], [300.0, 200.0], [100.0, 200.0]])
    drawn = pictures.with_board(image, found, found + 1.0, None)
    assert drawn.shape[1] == pictures.WIDTH_PX // 2
    assert drawn.any() and drawn.shape[0] < drawn.shape[1]
    sheet = pictures.contact_sheet([drawn] * 7, list("abcdefg"))
    assert sheet.shape[0] == 2 * (112 + 16) and sheet.shape[1] == 6 * 154


def test_depth_is_grey_and_nothing_is_black():
    depth = np.array([[1.0, 3.0], [np.nan, 2.0]], dtype=np.float32)
    grey = pictures.as_picture(depth)[..., 0].astype(int)
    assert grey[1, 0] == 0 and grey[0, 0] > grey[1, 1] > grey[0, 1] > 0


# ---- the first screen


def test_the_first_screen_says_what_the_verdict_says(given, page):
    verdict = given.calibration["verdict"]
    assert page.grade == verdict["grade"]
    assert page.sentence.rstrip(".").lower() == verdict["sentence"].rstrip(".").lower()
    assert [line.name for line in page.sensors] == list(verdict["sensors"])


def verdict(grade, sentence, **sensors):
    return {"grade": grade, "sentence": sentence, "sensors": sensors}


def test_of_two_results_the_worse_speaks_first():
    entry = {"grade": "good", "sentence": "known to 1 mm", "advice": None}
    bad = {"grade": "wrong", "sentence": "40 px off", "advice": "look at it"}
    solved = {
        "verdict": verdict("good", "all is well", a=entry),
        "sensors": {"a": {"modality": "rgb"}},
    }
    tested = {"verdict": verdict("wrong", "do not use it", a=bad)}
    both = Given(solved, tested)
    assert sentences(both) == ("wrong", "Do not use it.", "The calibration: good. All is well.")
    why = "40 px off; known to 1 mm."
    assert sensor_lines(both, {}) == [
        SensorLine("a", "rgb", "wrong", "wrong", why.capitalize(), "Look at it.")
    ]


def test_a_sensor_that_moved_is_not_called_good():
    """Neither by new boards nor by another calibration; the one that stands stays good."""
    entry = {"grade": "good", "sentence": "known to 1 mm", "advice": None}
    solved = {
        "verdict": verdict("good", "all is well", a=entry, b=entry),
        "sensors": {"a": {"modality": "rgb"}, "b": {"modality": "rgb"}},
    }
    gone = {"grade": "wrong", "sentence": "it has moved by 5 mm", "advice": "calibrate again"}
    stands = {"grade": "good", "sentence": "stands", "advice": None}
    by_boards = {"moved": True, "verdict": verdict("wrong", "a has moved", a=gone, b=stands)}
    size = {"translation_m": 0.005, "rotation_rad": np.radians(0.25)}
    edges = {"base-a": {"sensors": ["a"], "verdict": "moved", **size}}
    edges["base-b"] = {"sensors": ["b"], "verdict": "same", **size}
    compared = {"moved": True, "sentence": "they differ", "edges": edges}
    few_boards = {"a": Guidance((), ("tilt",))}
    for changes, why in (
        (by_boards, "It has moved by 5 mm; known to 1 mm."),
        (compared, "The two calibrations differ by 5.0 mm and 0.25 deg; known to 1 mm."),
    ):
        moved_one, other = sensor_lines(Given(solved, None, changes=(changes,)), few_boards)
        assert (moved_one.word, moved_one.why) == ("wrong", why)
        assert moved_one.advice and "ollect" not in moved_one.advice
        assert (other.word, other.why) == ("good", "Known to 1 mm.")


def test_what_the_data_leave_open_is_called_not_determined():
    entry = {"grade": "weak", "sentence": "the data leave its place open", "advice": None}
    weak = [{"parameters": ["base-rgb_1 z", "rgb_1"], "sigma": 1.0, "unit": "m", "why": "?"}]
    solved = {
        "verdict": verdict("weak", "open", rgb_1=entry, rgb_10=entry),
        "sensors": {"rgb_1": {"modality": "rgb"}, "rgb_10": {"modality": "rgb"}},
        "weak_directions": weak,
    }
    assert [line.word for line in sensor_lines(Given(solved, None), {})] == [
        "not determined",
        "weak",
    ]


def test_a_result_without_a_verdict_is_not_called_good():
    grade, sentence, _ = sentences(Given({"sensors": {}}, None))
    assert grade == "unknown" and "older version" in sentence


# ---- the page


class Outline(HTMLParser):
    """Collects what the page asks for from elsewhere, its links and what has no words."""

    def __init__(self, text):
        super().__init__()
        self.names, self.links, self.addresses, self.mute, self.tags = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.tags.append(tag)
        self.names += [values["id"]] if "id" in values else []
        self.addresses += [v for k, v in attributes if k in ("src", "href", "poster", "action")]
        if tag == "img" and not values.get("alt"):
            self.mute.append(attributes)


def test_the_page_asks_nothing_of_a_network_and_its_links_lead_somewhere(text):
    outline = Outline(text)
    assert len(outline.names) == len(set(outline.names))
    for address in outline.addresses:
        assert address.startswith("data:image/") or address[1:] in outline.names, address[:80]
    assert not outline.mute and "link" not in outline.tags
    assert "default-src 'none'" in text
    assert len(text) < 15e6


def test_the_page_has_the_sections_in_the_order_of_the_questions(page):
    names = [section.name for section in page.sections]
    order = ["moved", "residuals", "detections", "coverage", "worst", "clouds", "certainty"]
    assert names == [*order, "outliers", "labels", "making"]


def test_text_of_a_result_is_no_markup(given):
    document = json.loads(json.dumps(given.calibration))
    document["verdict"]["sentence"] = "<script>alert(1)</script>"
    document["warnings"] = ["<img src=x onerror=alert(1)>"]
    made = html.html(make_page(Given(document, None)))
    assert "<script>alert" not in made and "<img src=x" not in made
    assert html.script_json({"name": "</script>"}).count("<") == 0


def test_colours_of_words_are_read_by_weak_eyes():
    """WCAG AA asks for a contrast of 4.5."""
    style = (STATIC / "report.css").read_text()
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{3,6});", style))

    def luminance(colour):
        colour = colour if len(colour) == 7 else "#" + "".join(2 * c for c in colour[1:])
        parts = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
        linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ (0.2126, 0.7152, 0.0722))

    def contrast(one, other):
        high, low = sorted((luminance(one), luminance(other)), reverse=True)
        return (high + 0.05) / (low + 0.05)

    pairs = [
        ("#fff", colours[name]) for name in ("good", "wrong", "unknown", "soft", "ink", "link")
    ]
    pairs += [(colours["ink"], colours["weak"]), (colours["soft"], colours["pale"])]
    pairs += [(colours["ink"], "#fff6e0"), (colours["ink"], "#d5e8f3")]
    assert all(contrast(*pair) >= 4.5 for pair in pairs)


def test_the_paper_has_a_cover_and_its_pages_are_filled(page):
    data = pdf(page)
    assert data.startswith(b"%PDF") and len(data) < 15e6
    pages = len(re.findall(rb"/Type /Page\b", data))
    assert 2 <= pages <= len(page.sections)


def test_a_report_is_made_of_an_evaluation_alone_and_without_data(given):
    pair = {"source": "a", "target": "b", "kind": "rgb-rgb", "unit": "px", "reverse": False}
    figures = {"collections": 3, "points": 80, "rms": 1.0, "at_truth": None, "skipped": None}
    other = {**pair, **figures, "rms": 7.25}
    tested = {
        "train": "train.json",
        "test": "test.json",
        "pairs": [{**pair, **figures}],
        "averages": {"rgb-rgb": {"unit": "px", "rms": 1.0, "at_truth": None, "pairs": 1}},
        "ground_truth": None,
        "baselines": {
            "opencv_stereo": {"pairs": [other]},
            "kalibr": {"pairs": [], "skipped": "no camchain"},
        },
    }
    made = html.html(make_page(Given(None, tested)))
    assert "7.25" in made and "no camchain" in made and "opencv stereo" in made
    assert "plotly" not in made  # nothing to be turned
    assert "left out" in html.html(make_page(Given(given.calibration, None, None)))


def test_checks_and_changes_are_shown_where_they_are(given):
    one = {"sigmas": 1.25, "translation_m": 0.002, "rotation_rad": 0.001}
    checks = {
        "agree": False,
        "contradictions": ["two halves put a in different places"],
        "split_half": {"limit_sigmas": 3.6, "sensors": {"a": {**one, "sigmas": 9.75}}},
        "leave_one_out": {"limit_sigmas": 3.6, "sensors": {"a": one}},
        "loops": {"limit_sigmas": 3.6, "triangles": [{"sensors": ["a", "b", "c"], **one}]},
        "not_asked": ["nothing else"],
    }
    edge = {"sensors": ["a"], "verdict": "moved", "chi_square": 81.5, **one}
    moved_since = {
        **{"moved": True, "sentence": "a has moved", "edges": {"base-a": edge}},
        **{"before": "one", "after": "two", "limit_chi_square": 16.8, "false_alarm_rate": 0.01},
    }
    page = make_page(
        Given({**given.calibration, "trust_checks": checks}, None, changes=(moved_since,))
    )
    assert page.grade == "wrong" and page.sentence == "A has moved."
    names = [section.name for section in page.sections]
    assert names.index("changes") < names.index("certainty") < names.index("trust")
    made = html.html(page)
    for told in ("9.75", "81.5", "a, b, c", "Two halves put a in different places."):
        assert told in made


def test_the_scene_is_seen_from_the_poses(given):
    """What is drawn of a sensor stands at its place in the world."""
    dataset, first = given.dataset, next(iter(given.dataset.collections))
    scene = rig_scene(given, sightings(dataset))
    for entry in scene["sensors"]:
        sensor = dataset.sensors[entry["name"]]
        chain = dataset.graph.chain(dataset.world, sensor.frame)
        pose = np.eye(4)
        for edge, inverted in chain:
            step = dataset.collections[first].transforms[edge]
            pose = pose @ (se3.inverse(step) if inverted else step)
        assert entry["place"] == pytest.approx(pose[:3, 3], abs=1e-4)
