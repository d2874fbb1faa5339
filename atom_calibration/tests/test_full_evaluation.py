"""full_evaluation.launch: what is typed behind csf:= and ssf:= is what the command gets."""

import shlex

import pytest
from small_rig import write_package

from atom_calibration.configure import configure_package
from atom_core.cli import build_parser

SELECTIONS = (
    ["lambda x : int(x) in [0, 3]"],
    ['lambda s : s in ["rgb_1", "lidar_1"]'],
    ["lambda s: s != 'it is'"],
    ["000"],
    ["rgb_*", "!lidar_1"],
    [],
)


@pytest.fixture(scope="module")
def package(tmp_path_factory, make):
    folder = write_package(tmp_path_factory.mktemp("made"), make)
    assert configure_package.main(["-n", str(folder)]) == 0
    return folder


def evaluated(package, *arguments):
    """Return what `evaluate` gets of roslaunch's arguments."""
    loader = pytest.importorskip("roslaunch.xmlloader").XmlLoader()
    config = pytest.importorskip("roslaunch.config").ROSLaunchConfig()
    argv = ["train_json:=/a.json", "test_json:=/b.json", *arguments]
    path = package / "launch" / "full_evaluation.launch"
    loader.load(str(path), config, argv=argv, verbose=False)
    (node,) = config.nodes
    return build_parser().parse_args(["evaluate", *shlex.split(node.args)])


@pytest.mark.parametrize("option", ["csf", "ssf"])
@pytest.mark.parametrize("words", SELECTIONS)
def test_a_selection_reaches_the_evaluation_as_it_was_typed(package, option, words):
    args = evaluated(package, *([f"{option}:={' '.join(words)}"] if words else []))
    selections = {"csf": args.collection_selection_function, "ssf": args.sensor_selection_function}
    assert selections.pop(option) == (words or None)
    assert list(selections.values()) == [None]


def test_atoms_own_arguments_are_enough(package):
    """ATOM's launch file has no place of output; `evaluate` then writes beside the test set."""
    args = evaluated(package)
    assert (args.output, args.truth, args.overwrite) == (None, None, False)
    args = evaluated(package, "output:=/o f", "truth:=/t f", "overwrite:=true")
    assert (str(args.output), str(args.truth), args.overwrite) == ("/o f", "/t f", True)
