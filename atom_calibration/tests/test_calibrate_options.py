"""The node `calibrate` knows ATOM's options too; only there those of a live view mean something."""

import pytest

from atom_calibration.nodes.calibrating import calibrate
from atom_core.commands.atom_options import CALIBRATE


@pytest.mark.parametrize("option", CALIBRATE, ids=lambda option: option.short)
def test_every_option_of_atom_is_known_by_the_node(option, capsys):
    values = [] if not option.example else [option.example]
    values = option.example.split() if option.short == "nig" else values
    base = [] if option.short == "json" else ["-json", "dataset.json"]
    for name in option.names:
        args = calibrate.parser().parse_args([*base, name, *values])
        note = capsys.readouterr().err
        if option.ours is None:
            assert note == f"calibrate: note: {option.note}\n"
        else:
            assert not note and getattr(args, option.ours) not in (None, False)
