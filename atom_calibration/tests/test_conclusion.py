"""What a collector says where it has taken nothing."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from atom_calibration.collect.conclusion import conclude
from atom_calibration.errors import CollectionError
from atom_core.labeling.chessboard import ChessboardFinder


def said(tmp_path, asked, **found):
    collector = SimpleNamespace(
        **{
            "reasons": {"cam": Counter({"no board": 3})},
            "refused": [],
            "passed": [],
            "deleted": 0,
            **found,
        },
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


def test_where_no_chessboard_was_seen_it_is_told_what_dimension_counts(tmp_path):
    """A real 9 x 6, configured by its 10 x 7 squares, was told to be not seen and no more."""
    seen = ChessboardFinder(10, 7).find(np.full((100, 100), 128, np.uint8)).reason
    text = said(tmp_path, asked=True, reasons={"cam": Counter({seen: 3})})
    assert text.endswith(
        f"(cam: {seen}; dimension counts inner corners, one less than squares along each side)"
    )


def test_where_nobody_asked_for_a_collection_that_is_the_reason(tmp_path):
    text = said(tmp_path, asked=False)
    assert "nobody asked for one" in text and "--automatic" in text
    assert "stood still in view" not in text


def test_a_collection_that_was_asked_for_and_refused_is_the_reason(tmp_path):
    assert "its stamps" in said(tmp_path, asked=False, refused=["its stamps are apart"])


@pytest.mark.parametrize("asked", [True, False])
def test_where_all_collections_were_deleted_nothing_else_is_the_reason(tmp_path, asked):
    """It was told that nobody had asked for one, or that the board had never stood still."""
    text = said(tmp_path, asked, deleted=3)
    assert text.endswith("no collection is left: 3 taken, and deleted again")
