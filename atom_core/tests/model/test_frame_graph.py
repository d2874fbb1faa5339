"""Which frames hang together: found once for a dataset, and once from a frame to all others."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.model.transforms import Edge, FrameGraph, Step
from atom_core.synthetic import scenes


def tree(frames):
    """Return the edges of a random tree of so many frames."""
    rng = np.random.default_rng(0)
    return [Edge(f"f{rng.integers(i)}", f"f{i}") for i in range(1, frames)]


def test_a_dataset_has_one_graph_and_another_dataset_another():
    dataset = scenes.random_scene(0, collections=3).dataset
    assert dataset.graph is dataset.graph
    edge = next(iter(dataset.collections["000"].transforms))
    collections = {
        key: replace(c, transforms={e: m for e, m in c.transforms.items() if e != edge})
        for key, c in dataset.collections.items()
    }
    lacking = replace(dataset, collections=collections)
    assert dataset.graph.edges_between(*edge) and not lacking.graph.edges_between(*edge)


def test_chains_from_one_frame_are_searched_once(monkeypatch):
    searched, spread = [], FrameGraph._spread
    monkeypatch.setattr(FrameGraph, "_spread", lambda g, f: searched.append(f) or spread(g, f))
    graph = FrameGraph(tree(40))
    for target in ("f0", "f7"):
        for i in range(40):
            graph.chain(target, f"f{i}")
    assert searched == ["f0", "f7"]


def test_a_chain_is_the_one_back_turned_round():
    graph = FrameGraph(tree(30))
    for i in range(30):
        for j in range(30):
            there, back = graph.chain(f"f{i}", f"f{j}"), graph.chain(f"f{j}", f"f{i}")
            assert there == tuple(Step(s.edge, not s.inverted) for s in reversed(back))
            assert len({step.edge for step in there}) == len(there)


def test_frames_that_nothing_connects_are_named():
    graph = FrameGraph([Edge("a", "b"), Edge("c", "d")])
    with pytest.raises(DatasetError, match="no chain of transforms connects frame 'a' with"):
        graph.chain("a", "d")
    with pytest.raises(DatasetError, match="frame 'e' is in no transform"):
        graph.chain("a", "e")
