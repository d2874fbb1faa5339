"""Hours with the live collector: no save is dropped, memory is flat, 500 collections are whole."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from masters import running_master

from atom_core.io.dataset_json import read_dataset

pytestmark = pytest.mark.slow
pytest.importorskip("rospy")

SESSION = Path(__file__).with_name("long_session.py")
STOPS = 4  # of a play


def session(folder, plays, stop_s, what):
    """Run a session with a master of its own; return its figures."""
    with running_master(folder / "ros_home") as environment:
        done = subprocess.run(
            [sys.executable, SESSION, folder, str(plays), str(stop_s), what],
            env={**os.environ, **environment},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            timeout=6 * 3600,
            check=False,
        )
    assert done.returncode == 0, done.stderr[-4000:]
    return json.loads((folder / "figures.json").read_text(encoding="utf-8"))


def check_saves(figures, plays):
    assert figures["refused"] == [] and figures["saved"] == STOPS * plays
    assert figures["ran_to_the_end"]


def growth(memory_mb, warm):
    """Return by which part each node's memory grew after the plays that count as warm-up."""
    names = memory_mb[-1]
    return {
        name: np.median([m[name] for m in memory_mb[-5:]])
        / np.median([m[name] for m in memory_mb[warm : warm + 5]])
        - 1.0
        for name in names
    }


@pytest.mark.long(minutes=1)
def test_two_plays_drop_no_save(tmp_path):
    figures = session(tmp_path, 2, 0.8, "keep")
    check_saves(figures, 2)
    dataset = read_dataset(tmp_path / "dataset" / "dataset.json")
    assert list(dataset.collections) == [f"{i:03d}" for i in range(2 * STOPS)]
    nodes = figures["memory_mb"][-1]
    assert "/collect_data" in nodes and min(nodes.values()) > 10.0


@pytest.mark.long(minutes=140)
def test_memory_stays_flat_over_120_plays_of_a_minute(tmp_path):
    figures = session(tmp_path, 120, 15.0, "delete")
    print(json.dumps(figures["memory_mb"][::10]))
    check_saves(figures, 120)
    grown = growth(figures["memory_mb"], warm=12)
    assert max(grown.values()) <= 0.05, grown


@pytest.mark.long(minutes=10)
def test_500_collections_are_whole(tmp_path):
    figures = session(tmp_path, 125, 0.8, "keep")
    check_saves(figures, 125)
    dataset = read_dataset(tmp_path / "dataset" / "dataset.json")
    assert len(dataset.collections) == 500
    names = set(dataset.sensors)
    for key, collection in dataset.collections.items():
        assert {sensor for sensor, _ in collection.labels} == names, key
        assert all(dataset.data.has_data(key, name) for name in names), key
