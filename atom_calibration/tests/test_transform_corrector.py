"""Transforms corrected by hand: what was dragged outlasts the end of the node."""

from atom_calibration.nodes.correcting import transform_corrector
from atom_calibration.runtime import running
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


def test_drags_that_were_not_saved_are_kept_at_the_end_and_named(tmp_path, monkeypatch, capsys):
    dataset = scenes.two_cameras(collections=2).dataset
    write_dataset_folder(dataset, tmp_path, name="test")
    edge = list(dataset.sensors.values())[1].edge

    def drag(corrections, *_):
        matrix = corrections.value(edge).copy()
        matrix[0, 3] += 0.1
        corrections.set(edge, matrix)

    monkeypatch.setattr(transform_corrector, "TransformCorrector", drag)
    monkeypatch.setattr(running, "start", lambda _: None)
    monkeypatch.setattr(running, "wait", lambda: 0)
    words = ["-json", str(tmp_path / "dataset.json"), "-pll", edge.parent, "-cll", edge.child]
    assert transform_corrector.correct(transform_corrector.parser().parse_args(words)) == 0
    kept = tmp_path / "unsaved_dataset_corrected.json"
    error = capsys.readouterr().err
    assert error.startswith("transform_corrector: corrections were not saved")
    assert str(kept) in error
    for key, collection in read_dataset(kept).collections.items():
        before = dataset.collections[key].transforms[edge]
        assert abs(collection.transforms[edge][0, 3] - before[0, 3] - 0.1) < 1e-9
