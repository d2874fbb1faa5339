"""A recording of `rosbag record --split` is collected from as if it were one file."""

import json
import shutil

from stand_in_rig import messages, refusal

from atom_calibration.nodes.calibrating import calibrate_from_bag
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.bag_reader import BagReader
from atom_core.io.dataset_json import read_dataset

ENDS_S = 100.0, 103.1, 105.6, 1e9  # parts end amid a stop and between two of them


def split(place):
    """Write the recording, and its parts beside it; return the latter and the arguments."""
    arguments = place()
    content = list(messages(place.make))
    parts = [
        place.make.bag(
            place.root / f"rig_2026-11-26-18-00-00_{number}.bag",
            [m for m in content if first_s <= m[2] < end_s],
        )
        for number, (first_s, end_s) in enumerate(zip(ENDS_S, ENDS_S[1:]))
    ]
    at = arguments.index("--bag") + 1
    return parts, lambda *bags: [*arguments[:at], *map(str, bags), *arguments[at + 1 :]]


def collected(place, arguments):
    """Collect; return the dataset's document without when and of what, and its number of files."""
    shutil.rmtree(place.folder, ignore_errors=True)
    assert main(arguments) == 0
    document = read_dataset(place.folder / "dataset.json").document
    document["_metadata"] = {}
    return json.dumps(document, sort_keys=True), len(list(place.folder.iterdir()))


def test_parts_give_the_dataset_of_the_whole_recording(place):
    parts, arguments = split(place)
    whole = collected(place, arguments(place.root / "a.bag"))
    assert len(read_dataset(place.folder / "dataset.json").collections) == 3
    assert collected(place, arguments(*parts)) == whole
    assert collected(place, arguments(place.root / "rig_*_?.bag")) == whole


def test_only_the_first_part_has_the_static_transforms(place, capsys):
    parts, arguments = split(place)
    with BagReader(parts[1]) as second:
        assert "/tf_static" not in second.types
    shutil.rmtree(place.folder, ignore_errors=True)
    line = refusal(arguments(parts[1]), capsys)
    assert "cam_optical" in line and "/tf_static" in line


def test_one_part_alone_is_told_that_there_are_others(place, capsys):
    parts, arguments = split(place)
    main(arguments(parts[1]))
    said = capsys.readouterr().err
    assert f"warning: {parts[1]}: {parts[0].name} ... beside it may be parts" in said
    assert f"--bag '{place.root}/rig_2026-11-26-18-00-00_*.bag'" in said
    main(arguments(*parts))
    assert "may be parts" not in capsys.readouterr().err


def test_calibrate_from_bag_passes_all_of_them_on():
    words = ["--config", "c.yml", "--bag", "a_0.bag", "a_1.bag", "--output", "out"]
    assert [str(bag) for bag in calibrate_from_bag.parser().parse_args(words).bag] == words[3:5]
