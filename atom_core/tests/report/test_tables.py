"""Plain-text tables."""

import numpy as np

from atom_core.report.tables import by_collection_table, text_table


def test_numbers_stand_to_the_right_words_to_the_left_and_the_unknown_is_a_dash():
    text = text_table(
        ["sensor", "RMS [px]", "n"], [["a", 1.23456, 3], ["long_name", None, 12]], "Title"
    )
    assert text.splitlines() == [
        "Title",
        "sensor       RMS [px]    n",
        "---------  ----------  ---",
        "a              1.2346    3",
        "long_name         ---   12",
    ]


def test_texts_that_look_like_numbers_stay_as_they_are():
    text = text_table(["collection", "x"], [["000", np.float64(2.0)], ["017", np.nan]], digits=1)
    assert text.splitlines()[2:] == ["000           2.0", "017           ---"]


def test_truths_are_words():
    assert "yes" in text_table(["ok"], [[True]]) and "no" in text_table(["ok"], [[np.bool_(False)]])


def test_a_table_without_rows_has_its_headers():
    assert text_table(["a", "b"], []).split() == ["a", "b", "---", "---"]


def test_what_more_sensors_saw_than_fit_beside_each_other_stands_below_each_other():
    names = [f"rgb_{n}" for n in range(1, 121)]
    rows = [[f"{k:03d}", *["88"] * 120] for k in range(10)] + [["seen in", *["10"] * 120]]
    turned = by_collection_table(names, rows, "Detections").splitlines()
    assert turned[1].split() == ["Collection", *(f"{k:03d}" for k in range(10)), "seen", "in"]
    assert turned[-1].split() == ["rgb_120", *["88"] * 10, "10"]
    assert len(turned) == 123 and max(map(len, turned)) < 120
    few = by_collection_table(names[:7], [row[:8] for row in rows], "Detections").splitlines()
    assert few[1].split() == ["Collection", *names[:7]] and len(few) == 14
