"""What a collector says where it has taken nothing."""

from collections import Counter
from types import SimpleNamespace

import pytest

from atom_calibration.collect.conclusion import conclude
from atom_calibration.errors import CollectionError


def said(tmp_path, asked, **found):
    collector = SimpleNamespace(
        **{"reasons": {"cam": Counter({"no board": 3})}, "refused": [], "passed": [], **found},
        withdraw=lambda: None,
    )
    with pytest.raises(CollectionError) as error:
        conclude(SimpleNamespace(folder=tmp_path, keys=[]), collector, [], print, print, asked)
    return str(error.value)


def test_boards_that_never_stood_still_are_the_reason_where_collections_are_taken_by_themselves(
    tmp_path,
):
    text = said(tmp_path, asked=True)
    assert text.endswith("the board never stood still in view (cam: no board)")


def test_of_single_pictures_that_all_show_the_board_the_options_that_take_them_are_named(tmp_path):
    text = said(tmp_path, asked=True, reasons={})
    assert text.endswith("collect_from_bag --times or --interval")


def test_where_nobody_asked_for_a_collection_that_is_the_reason(tmp_path):
    text = said(tmp_path, asked=False)
    assert "nobody asked for one" in text and "--automatic" in text
    assert "stood still in view" not in text


def test_a_collection_that_was_asked_for_and_refused_is_the_reason(tmp_path):
    assert "its stamps" in said(tmp_path, asked=False, refused=["its stamps are apart"])
