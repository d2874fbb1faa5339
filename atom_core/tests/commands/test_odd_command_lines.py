"""Whatever options a command is given, it ends with its results or with a sentence.

Some command lines that Hypothesis draws run in `make test`, many more in `make test-long`.
"""

import argparse
import shutil
import sys
from pathlib import Path

import pytest

pytest.importorskip("hypothesis")
sys.path.insert(0, str(Path(__file__).parents[1]))  # damage, odd_options

from damage import for_all  # noqa: E402
from hypothesis import strategies as st  # noqa: E402
from odd_options import command_line  # noqa: E402

from atom_core import cli  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic.scenes import random_scene  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]
# They open a window, or start the whole job.
OTHERS = {"demo", "annotate_pattern_borders_in_rgb_or_depth", "annotate_pattern_borders_in_lidar"}
RENAMING = {"rename_atom_dataset"}
DATASETS = {"dataset", "dataset_path", "json_file", "train", "test", "json_input"}
RUNS_OTHERS = {"batch_execution"}  # ten times as long as any other
DRAWS = [8, pytest.param(100, marks=pytest.mark.long)]


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Return a folder with a dataset of two cameras, a depth camera and a LiDAR."""
    folder = tmp_path_factory.mktemp("made") / "data"
    return write_dataset_folder(random_scene(0, collections=4).dataset, folder, name="four").parent


def options_of(name):
    """Return the options of a command, as argparse has them."""
    commands = cli.build_parser(name)._subparsers._group_actions[0].choices
    return [o for o in commands[name]._actions if not isinstance(o, argparse._HelpAction)]


def usual(option):
    """Return what an option mostly is."""
    if option.dest in DATASETS:
        return "data" if option.dest == "dataset_path" else "data/dataset.json"
    return "out" if option.dest.startswith("output") else None


@st.composite
def command_lines(draw, name):
    """Draw a command line: mostly with a dataset and a place for results, and odd options."""
    return [name, *command_line(draw, options_of(name), usual)]


@pytest.mark.sampled(24)
@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("name", sorted(set(cli.COMMANDS) - OTHERS))
def test_odd_options_are_taken_or_refused(name, data, tmp_path, monkeypatch, capsys, draws):
    whole = (data / "dataset.json").read_bytes()

    def check(words):
        shutil.rmtree(tmp_path / "here", ignore_errors=True)
        shutil.copytree(data, tmp_path / "here" / "work" / "data")
        monkeypatch.chdir(tmp_path / "here" / "work")
        try:
            code = cli.main(words)
        except SystemExit as end:  # argparse's own refusals, --version
            code = end.code
        said = capsys.readouterr().err
        assert code in (0, 1, 2), code
        assert code != 2 or said.strip(), "a refusal says why"
        dataset = Path("data") / "dataset.json"
        changes_it = name in RENAMING or "--in_place" in words
        assert changes_it or dataset.read_bytes() == whole, "the input is as it was"

    for_all(command_lines(name), draws // 4 if name in RUNS_OTHERS else draws, check)
    monkeypatch.chdir("/")  # until monkeypatch takes it back, the folder may be gone
