"""A camera on an arm in the published layouts of hand-eye data, for tests."""

from command_line import run

from atom_core.io.config_yaml import write_config
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import pose
from atom_core.synthetic import Noise, scenes

CAMERA, FLANGE = "rgb_1", "flange"


def made_layouts(folder):
    """Put a dataset of a camera on an arm, its configuration and both layouts into a folder.

    Returns:
        The folder, and the scene.
    """
    scene = scenes.hand_eye(1, collections=7, noise=Noise.none())
    write_dataset_folder(scene.dataset, folder / "data", name="arm")
    write_config(folder / "config.yml", scene.dataset.config)
    for layout, more in (("rwhe", ["-e", CAMERA, "-sf", "world", "-tf", FLANGE, "-sd"]),):
        run(f"convert_to_{layout}_dataset", *to(folder, layout), *more)
    run("convert_to_tabb_dataset", *to(folder, "tabb"), "-hl", FLANGE)
    return folder, scene


def to(folder, name):
    return "-json", folder / "data" / "dataset.json", "-out", folder / name


def world_T_flange(dataset):
    graph = dataset.graph
    return [pose(c, graph, "world", FLANGE) for c in dataset.collections.values()]


def from_layout(folder, layout, output, *more):
    source = {"rwhe": ["-rwhe", folder / "rwhe", "-s", CAMERA], "tabb": ["-ds", folder / "tabb"]}
    tail = ["-json", folder / "config.yml", "-out", output, *more]
    return [f"convert_from_{layout}_dataset", *source[layout], *tail]
