"""Plain-text tables."""

import numpy as np

from atom_core.report.tables import text_table


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
