"""Templates to the texts of launch files, RViz configurations and the skeleton of a package."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence

import jinja2

from atom_calibration.configure.check import BagFacts
from atom_calibration.configure.package import CalibrationPackage, launch_text
from atom_calibration.configure.viewpoint import Viewpoint, viewpoint
from atom_calibration.configure.window import HEIGHT, WIDTH, Side, window_state
from atom_calibration.modalities.table import ros_modality
from atom_calibration.runtime.graph_names import graph_name
from atom_calibration.sources.joint_topics import JOINT_STATES, is_told, played
from atom_core.io.paths import package_folder
from atom_core.model.colours import in_order, sensor_colours
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import Dataset
from atom_core.model.modality import modalities, modality_named
from atom_core.model.robot import FIXED
from atom_core.model.transforms import Transforms

# Each is made from the template of its name; a launch file is listed once all its nodes exist.
LAUNCH_FILES = (
    *("playbag", "set_initial_estimate", "collect_data", "dataset_playback", "calibrate"),
    "full_evaluation",
)
RVIZ_FILES = ("playbag", "set_initial_estimate", "collect_data", "dataset_playback", "calibrate")
SKELETON = {
    "package.xml": "package.xml.j2",
    "CMakeLists.txt": "CMakeLists.txt.j2",
    "scripts/configure": "configure.j2",
    "calibration/config.yml": "config.yml.j2",
}
# What launch files start, as roslaunch-check wants it in the manifest of a calibration package.
PACKAGES = ("atom_calibration", "robot_state_publisher", "rosbag", "rviz", "xacro")
_THROTTLING = "topic_tools"
# Of RViz configurations: the page of the panel, and displays with panes that are no sensors.
_PAGES = {"collect_data": 0, "calibrate": 1, "dataset_playback": 2, "set_initial_estimate": 3}
_IMAGE_PANES = {"calibrate": ["Images"]}
_PANEL_PX, _DISPLAYS_PX, _IMAGES_PX = 480, 300, 380  # width
MADE_BY = "Made by `configure` from {config}; it tells before it replaces what you edit."


def rendered_files(
    config: CalibrationConfig,
    facts: BagFacts,
    package: CalibrationPackage,
    transforms: Optional[Transforms] = None,
) -> Dict[str, str]:
    """Return the texts of launch and RViz files by their path in the package.

    Args:
        config: with the modality of each sensor.
        facts: what the bag tells.
        package: that the files are for.
        transforms: of the rig as it is described; RViz looks from behind its cameras.
    """
    view = viewpoint(config, transforms or {})
    values = {**template_values(config, facts, package), "view": view}
    names = [f"launch/{name}.launch" for name in LAUNCH_FILES]
    names += [f"rviz/{name}.rviz" for name in RVIZ_FILES]
    environment = _environment()
    return {
        name: environment.get_template(f"{Path(name).name}.j2").render(
            {**values, **window_values(Path(name).stem, values)}
        )
        for name in names
    }


def needed_packages(config: CalibrationConfig) -> List[str]:
    """Return the packages whose nodes the launch files start."""
    throttles = any(entry.throttle for entry in config.sensors.values())
    return [*PACKAGES, *([_THROTTLING] if throttles else [])]


def skeleton_files(name: str) -> Dict[str, str]:
    """Return the texts of a new package by their path in it."""
    environment = _environment()
    values = {
        "name": name,
        "packages": [*PACKAGES, _THROTTLING],
        "modalities": _listed([kind.name for kind in modalities()]),
        "named_modalities": _listed([k.name for k in modalities() if not k.is_default_of]),
    }
    return {
        path: environment.get_template(template).render(values)
        for path, template in SKELETON.items()
    }


def collecting_view(config: CalibrationConfig) -> str:
    """Return an RViz configuration for collecting without a calibration package.

    Args:
        config: each sensor with its modality.
    """
    values = {"made_by": "Made by `collect_data_rviz`.", **_sensor_values(config)}
    values.update(window_values("collect_data", values))
    return _environment().get_template("collect_data.rviz.j2").render(values)


def correcting_view(dataset: Dataset) -> str:
    """Return an RViz configuration for correcting labels without a calibration package."""
    config = dataset.config
    sensors = {
        name: replace(entry, modality=dataset.sensors[name].modality)
        for name, entry in config.sensors.items()
        if name in dataset.sensors
    }
    values = _sensor_values(replace(config, sensors=sensors))
    # nobody has said which description the robot has
    values = {"made_by": "Made by `dataset_playback_rviz`.", "with_robot": False, **values}
    values.update(window_values("dataset_playback", values))
    return _environment().get_template("dataset_playback.rviz.j2").render(values)


def template_values(
    config: CalibrationConfig, facts: BagFacts, package: CalibrationPackage
) -> Mapping[str, Any]:
    """Return what the templates may use."""
    values = _sensor_values(config)
    for sensor in values["sensors"]:
        sensor["data_topic"] = facts.data_topics[sensor["name"]]
    return {
        **values,
        "made_by": MADE_BY.format(config=package.config_file.name),
        "find": package.find,
        "config_file": package.launch_path(package.config_file),
        "bag_file": _bag_text(config.bag_file, package),
        "compressed": [s["data_topic"] for s in values["sensors"] if s["data_topic"] != s["topic"]],
        "throttles": any(s["throttle"] for s in values["sensors"]),
        **_joint_values(facts),
    }


def _joint_values(facts: BagFacts) -> Dict[str, Any]:
    """Return which topics are played as /joint_states, and which joints these do not tell."""
    if facts.robot is None:
        return {"joint_topics": [], "joints_of_bag": ""}
    topics = played(facts.joints, facts.robot)
    told = frozenset().union(*topics.values())
    moving = [joint for joint in facts.robot.joints.values() if joint.type != FIXED]
    untold = [joint.name for joint in moving if not is_told(joint, told)]
    some = untold if len(untold) < len(moving) else []  # all: they need not be named
    return {
        "joint_topics": [topic for topic in topics if topic != JOINT_STATES],
        "joints_of_bag": " ".join(["--moving_joints", *some]) if untold else "",
    }


def window_values(name: str, values: Mapping[str, Any]) -> Dict[str, Any]:
    """Return how a window is laid out.

    Args:
        name: of the RViz configuration.
        values: of its template, with the sensors.
    """
    images = [sensor["name"] for sensor in values["sensors"] if sensor["is_image"]]
    panes = _IMAGE_PANES.get(name, images)
    page = _PAGES.get(name)
    tabs = ["Displays"] if page is None else ["ATOM", "Displays"]
    left = Side(tabs, _DISPLAYS_PX if page is None else _PANEL_PX)
    return {
        "has_panel": page is not None,
        "page": page,
        "image_panes": panes,
        "window_state": window_state(left, Side(panes, _IMAGES_PX)),
        "window_width": WIDTH,
        "window_height": HEIGHT,
    }


def _sensor_values(config: CalibrationConfig) -> Dict[str, Any]:
    """Return what the configuration alone says."""
    sensors: List[Dict[str, Any]] = []
    colours = sensor_colours(config.sensors)
    for name in in_order(config.sensors):
        entry = config.sensors[name]
        colour = "; ".join(str(round(255 * value)) for value in colours[name])
        sensors.append(
            {
                "name": name,
                "graph_name": graph_name(name),
                "frame": entry.link,
                "topic": entry.topic_name,
                "throttle": entry.throttle,
                "colour": colour,
                **_display_values(entry.modality),
            }
        )
    return {
        "world": config.world_link,
        "view": Viewpoint(),
        "sensors": sensors,
        "data_frames": _unique([s["frame"] for s in sensors]),
    }


def _display_values(name: Optional[str]) -> Dict[str, Any]:
    """Return how RViz shows the data and labels of a modality; of None nothing."""
    if name is None:
        return {"is_image": False, "is_range": False, "has_seeds": False}
    kind, ros = modality_named(name), ros_modality(name)
    return {
        "is_image": kind.has_camera_info,
        "is_range": kind.measures_range,
        "has_seeds": ros.seeds is not None,
        "display": ros.display,
        "polygon_first": ros.polygon_first,
    }


def _listed(names: Sequence[str]) -> str:
    return " or ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


def _bag_text(bag_file: Optional[str], package: CalibrationPackage) -> str:
    return launch_text(bag_file, package) if bag_file else ""


def _unique(words: Sequence[str]) -> List[str]:
    return list(dict.fromkeys(words))


def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(str(package_folder("atom_calibration") / "templates")),
        undefined=jinja2.StrictUndefined,
        autoescape=_needs_escaping,
        keep_trailing_newline=True,
    )


def _needs_escaping(template: Optional[str]) -> bool:
    """XML is escaped, so that a quote or an ampersand in a path does not break a launch file."""
    return template is not None and template.endswith((".launch.j2", ".xml.j2"))
