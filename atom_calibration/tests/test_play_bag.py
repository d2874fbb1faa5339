"""A recording is played by `rosbag play`; what cannot be opened is one sentence."""

import sys

import pytest

from atom_calibration.nodes.bags import play_bag
from atom_core.errors import ConfigError


@pytest.fixture
def standing_in(tmp_path, monkeypatch):
    """Stand in a folder with a recording."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "train.bag").write_bytes(b"#ROSBAG V2.0\n")
    return tmp_path


def test_it_becomes_rosbag_play_with_the_options_in_order_and_the_remappings(
    standing_in, monkeypatch
):
    became = []
    monkeypatch.setattr(
        play_bag.os, "execv", lambda program, words: became.append((program, words))
    )
    words = ["--clock", "--loop", "--rate=2", "--bag=train.bag", "/tf:=/bag/tf", "__name:=playbag"]
    monkeypatch.setattr(sys, "argv", ["play_bag", *words])
    play_bag.main()
    ((program, passed),) = became
    assert program.endswith("/play") and passed[0] == program
    bag = str(standing_in / "train.bag")
    remapped = ["/tf:=/bag/tf", "__name:=playbag"]
    assert passed[1:] == ["--clock", "--loop", "--rate=2", bag, *remapped]


def test_a_recording_in_parts_is_played_whole(standing_in):
    for number in (10, 2, 0):
        (standing_in / f"rig_{number}.bag").write_bytes(b"#ROSBAG V2.0\n")
    files = [standing_in / f"rig_{number}.bag" for number in (0, 2, 10)]
    assert play_bag.readable_bags("rig_*.bag") == files


@pytest.mark.parametrize(
    ("bag", "said"),
    [
        ("", "no recording: bag_file of the configuration is empty; give bag_file:=FILE"),
        ("nope.bag", "nope.bag: no such recording, looked for at {}/nope.bag; correct the path"),
        (".", ".: a folder; give the .bag file in it"),
    ],
)
def test_what_cannot_be_played_is_refused_with_where_it_was_looked_for(standing_in, bag, said):
    with pytest.raises(ConfigError) as refused:
        play_bag.readable_bags(bag)
    assert str(refused.value) == said.format(standing_in)


def test_a_refusal_ends_the_launch(standing_in, monkeypatch, capsys):
    ended = []
    monkeypatch.setattr(play_bag.running, "give_up_launch", lambda: ended.append(True))
    monkeypatch.setattr(sys, "argv", ["play_bag", "--clock", "--bag=nope.bag"])
    assert play_bag.main() == 2 and ended == [True]
    assert capsys.readouterr().err.startswith("play_bag: nope.bag: no such recording")
