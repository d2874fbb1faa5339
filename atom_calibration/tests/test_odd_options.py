"""Whatever options a program is given that reads bags, it ends with its work or with a sentence.

Some command lines that Hypothesis draws run in `make test`, many more in `make test-long`.
"""

import argparse
import shutil
import sys
from pathlib import Path

import pytest
from small_rig import write_package

pytest.importorskip("hypothesis")
sys.path.insert(0, str(Path(__file__).parents[2] / "atom_core" / "tests"))  # damage, odd_options

from damage import for_all  # noqa: E402
from hypothesis import strategies as st  # noqa: E402
from odd_options import command_line  # noqa: E402

from atom_calibration.configure import (  # noqa: E402
    configure_package,
    create_package,
    update_config,
    update_script,
    view_config,
)
from atom_calibration.nodes.bags import (  # noqa: E402
    atom_dataset_to_rosbag,
    joint_states,
    robot_description,
)
from atom_calibration.nodes.collecting import collect_from_bag  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic.scenes import random_scene  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]
DRAWS = [8, pytest.param(100, marks=pytest.mark.long)]
USUAL = {
    "config": "calibration/config.yml",
    "config_file": "calibration/config.yml",
    "bag": "calibration/rig.bag",
    "bagfile_in": "calibration/rig.bag",
    "bagfile_out": "out.bag",
    "output": "out",
    "name": ".",
    "package_name": ".",
    "dataset": "data/dataset.json",
}
PROGRAMS = {
    "collect_from_bag": (collect_from_bag.main, collect_from_bag.parser),
    "configure": (configure_package.main, configure_package.parser),
    "create": (create_package.main, create_package.parser),
    "update_config": (update_config.main, update_config.parser),
    "update_script": (update_script.main, update_script.parser),
    "view": (view_config.main, view_config.parser),
    "add_noise": (joint_states.add_noise, joint_states.noise_parser),
    "to_bag": (atom_dataset_to_rosbag.main, atom_dataset_to_rosbag.parser),
    "description": (robot_description.main, robot_description.parser),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory, make):
    """Return a package with its recording, and a dataset beside its configuration."""
    folder = write_package(tmp_path_factory.mktemp("made"), make, seconds=1.0)
    write_dataset_folder(random_scene(0, collections=3).dataset, folder / "data", name="three")
    return folder


@st.composite
def command_lines(draw, parser):
    """Draw a command line: mostly with the usual files, and odd options."""
    told = (argparse._HelpAction, argparse._VersionAction)
    options = [option for option in parser()._actions if not isinstance(option, told)]
    return command_line(draw, options, lambda option: USUAL.get(option.dest))


@pytest.mark.sampled(5)
@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("name", PROGRAMS)
def test_odd_options_are_taken_or_refused(name, made, tmp_path, monkeypatch, capsys, draws):
    main, parser = PROGRAMS[name]

    def check(words):
        shutil.rmtree(tmp_path / "here", ignore_errors=True)
        shutil.copytree(made, tmp_path / "here" / "small_rig_calibration")
        monkeypatch.chdir(tmp_path / "here" / "small_rig_calibration")
        try:
            code = main(words)
        except SystemExit as end:  # argparse's own refusals
            code = end.code
        said = capsys.readouterr().err
        assert code in (0, 1, 2), code
        assert code != 2 or said.strip(), "a refusal says why"

    for_all(command_lines(parser), draws, check)
    monkeypatch.chdir("/")
