"""A dataset without collections is refused in one sentence, whatever is asked of it."""

import json

import pytest

from atom_core.cli import main
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic.scenes import random_scene

URDF = '<robot name="r"><link name="world"/></robot>'


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a dataset, a test set without collections, and a description."""
    write_dataset_folder(random_scene(1, rgb=2, collections=2).dataset, tmp_path, name="train")
    document = json.loads((tmp_path / "dataset.json").read_text("utf-8"))
    text = json.dumps({**document, "collections": {}})
    (tmp_path / "empty.json").write_text(text, "utf-8")
    (tmp_path / "rig.urdf").write_text(URDF, "utf-8")
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        "calibrate --dataset {0}/empty.json --output {0}/out",
        "check --dataset {0}/empty.json",
        "check --dataset {0}/empty.json --against {0}/rig.urdf",
        "evaluate --train {0}/dataset.json --test {0}/empty.json --output {0}/out",
    ],
)
def test_it_is_refused_and_nothing_is_written(words, folder, capsys):
    assert main(words.format(folder).split()) == 2
    told = f"{folder / 'empty.json'}: there are no collections, so nothing can be measured"
    assert told in capsys.readouterr().err
    assert not (folder / "out").exists()
