"""From a bag to a calibration in one go, where no ROS master is needed."""

import json
from pathlib import Path

import pytest

from atom_calibration.nodes.calibrating import calibrate_from_bag
from atom_calibration.nodes.collecting import collect_from_bag
from atom_calibration.sources.described_bag import SAVED
from atom_core.io.collections import CollectionStore


@pytest.mark.parametrize(
    ("step", "taken"), [("collect", False), ("collect", True), ("calibrate", False)]
)
def test_ctrl_c_is_one_line_and_stands_in_the_status(place, capsys, monkeypatch, step, taken):
    def interrupted(*_):
        if taken:
            store = CollectionStore.create(place.folder / "dataset")
            store.write_header({})
            (place.folder / "dataset" / "collections" / "000.json").write_text("{}")
        raise KeyboardInterrupt

    arguments = place()
    if step == "collect":
        monkeypatch.setattr(collect_from_bag, "collect_from_bag", interrupted)
    else:
        monkeypatch.setattr(calibrate_from_bag.calibrate, "run", interrupted)
    assert calibrate_from_bag.main(arguments) == 130
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith(f"calibrate_from_bag: {step}: interrupted")
    assert ("recover" in line) == taken
    assert ("before the first collection" in line) == (step == "collect" and not taken)
    status = json.loads((place.folder / "status.json").read_text())
    assert (status["step"], status["exit_code"]) == (step, 130)
    assert line.endswith(status["message"])


@pytest.mark.parametrize(
    "words, description, received",
    [
        ([], None, ""),
        (["--description="], None, ""),  # as the launch file says that there is none
        (["--description"], SAVED, ""),
        (["--description", "--overwrite", "--use_receive_time", "cam"], SAVED, "cam"),
        (["--description", "a.urdf", "--use_receive_time", "cam", "lidar"], "a.urdf", "cam lidar"),
    ],
)
def test_what_a_refusal_of_collecting_advises_is_passed_on(
    place, monkeypatch, words, description, received
):
    def heard(args):
        assert args.description == (None if description is None else Path(description))
        assert list(args.use_receive_time) == received.split()
        raise KeyboardInterrupt

    monkeypatch.setattr(collect_from_bag, "collect_from_bag", heard)
    assert calibrate_from_bag.main([*place(), *words]) == 130
