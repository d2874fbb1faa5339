"""The nodes know ATOM's options: with its meaning, or answered with a note."""

import shlex

import pytest

from atom_calibration.configure import (
    configure_package,
    create_package,
    update_config,
    view_config,
)
from atom_calibration.nodes.calibrating import calibrate
from atom_calibration.nodes.collecting import collect_data, collect_data_rviz, labeler
from atom_calibration.nodes.correcting import (
    dataset_playback,
    dataset_playback_rviz,
    odometry_inspector,
    transform_corrector,
)
from atom_calibration.nodes.estimating import set_initial_estimate
from atom_core.commands import atom_options

NODES = {
    "calibrate": (calibrate.parser, atom_options.CALIBRATE, "-json a.json"),
    "collect_data": (collect_data.parser, atom_options.COLLECT_DATA, "-o DIR -c a.yml"),
    "rgb_labeler": (
        lambda: labeler._parser("rgb_labeler"),
        atom_options.LABELER,
        "-cfg a.yml -sn camera",
    ),
    "dataset_playback": (
        dataset_playback.parser,
        atom_options.DATASET_PLAYBACK,
        "-json a.json",
    ),
    "transform_corrector": (
        transform_corrector.parser,
        atom_options.TRANSFORM_CORRECTOR,
        "-json a.json -pll a -cll b",
    ),
    "odometry_inspector": (
        odometry_inspector.parser,
        atom_options.ODOMETRY_INSPECTOR,
        "-json a.json -op odom -oc base",
    ),
    "update_config_to_version_3": (
        update_config.parser,
        atom_options.UPDATE_CONFIG_TO_VERSION_3,
        "-pn robot",
    ),
    "view_calibration_config": (
        view_config.parser,
        atom_options.CONFIGURE_CALIBRATION_PKG,
        "-n robot",
    ),
    "set_initial_estimate": (
        set_initial_estimate.parser,
        atom_options.SET_INITIAL_ESTIMATE,
        "-c a.yml",
    ),
    "configure_calibration_pkg": (
        configure_package.parser,
        atom_options.CONFIGURE_CALIBRATION_PKG,
        "-n robot",
    ),
    "create_calibration_pkg": (
        create_package.parser,
        atom_options.CREATE_CALIBRATION_PKG,
        "-n robot",
    ),
}


@pytest.mark.parametrize(
    ("node", "option"),
    [(node, option) for node, (_, options, _) in NODES.items() for option in options],
    ids=lambda value: getattr(value, "short", value),
)
def test_every_option_of_atom_is_known_by_both_names(node, option, capsys):
    make, _, needed = NODES[node]
    values = shlex.split(option.example)
    if len(values) > 1 and values[0] == "lambda":
        values = [option.example]
    for name in option.names:
        args = make().parse_args([*_without(needed.split(), option.names), name, *values])
        note = capsys.readouterr().err
        if option.ours is None:
            assert note == f"{node}: note: {option.note}\n"
        else:
            assert not note and getattr(args, option.ours) not in (None, False)


def _without(words, names):
    """Return a command line without an option and its value."""
    places = [i for i, word in enumerate(words) if word in names]
    return [word for i, word in enumerate(words) if i not in places and i - 1 not in places]


@pytest.mark.parametrize(
    ("node", "needed"), [(collect_data_rviz, "-cfg a.yml"), (dataset_playback_rviz, "-json a.json")]
)
def test_what_is_meant_for_rviz_passes(node, needed):
    theirs = ["-d", "a.rviz", "--fullscreen", "__name:=rviz"]
    _, rest = node.parser().parse_known_args([*needed.split(), *theirs])
    assert rest == theirs
