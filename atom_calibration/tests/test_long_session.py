"""Hours with the live collector: no save is dropped, memory is flat."""

import json

import numpy as np
import pytest
from played_sessions import STOPS, check_saves, session

from atom_core.io.dataset_json import read_dataset

pytestmark = pytest.mark.slow
pytest.importorskip("rospy")


def growth(memory_mb, warm):
    """Return by which part each node's memory grew after the plays that count as warm-up."""
    names = memory_mb[-1]
    return {
        name: np.median([m[name] for m in memory_mb[-5:]])
        / np.median([m[name] for m in memory_mb[warm : warm + 5]])
        - 1.0
        for name in names
    }


@pytest.mark.long(minutes=140)
def test_memory_stays_flat_over_120_plays_of_a_minute(tmp_path):
    figures = session(tmp_path, 120, 15.0, "delete")
    print(json.dumps(figures["memory_mb"][::10]))
    check_saves(figures, 120)
    grown = growth(figures["memory_mb"], warm=12)
    assert max(grown.values()) <= 0.05, grown


@pytest.mark.long(minutes=1)
def test_two_plays_drop_no_save(tmp_path):
    figures = session(tmp_path, 2, 0.8, "keep")
    check_saves(figures, 2)
    dataset = read_dataset(tmp_path / "dataset" / "dataset.json")
    assert list(dataset.collections) == [f"{i:03d}" for i in range(2 * STOPS)]
    nodes = figures["memory_mb"][-1]
    assert "/collect_data" in nodes and min(nodes.values()) > 10.0
