"""Which robot description tells a bag's transforms, if one does."""

from __future__ import annotations

from pathlib import Path
from typing import Callable, List, Optional, Tuple

from atom_calibration.errors import TransformError
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.bag_transforms import BagTransforms, tf_topics
from atom_calibration.sources.described_edges import JOINT_STATE, DescribedEdges
from atom_calibration.sources.rig import Rig
from atom_calibration.sources.sound_transforms import SoundTransforms
from atom_calibration.sources.transform_tree import DEFAULT_MAX_GAP_S, TransformTree
from atom_core.io.urdf import read_description
from atom_core.model.config import CalibrationConfig

FIRST_GUESS = Path("urdf", "initial_estimate.urdf.xacro")  # in a calibration package
SAVED = Path()  # of the option without a file: the package's first guess, or the configuration's


def transforms_of_bag(
    bag: BagReader,
    description: Optional[Path],
    config: CalibrationConfig,
    config_file: Path,
    warn: Callable[[str], None],
) -> Tuple[BagTransforms, Optional[DescribedEdges], List[str]]:
    """Return the transforms of a bag, which of them a description tells, and remarks.

    Args:
        bag: the recording.
        description: URDF or xacro; `SAVED` for that of the calibration package; None: /tf alone,
            or that of the package where the bag has none.
        config: may name a description.
        config_file: where it stands; a package's first guess is beside its folder.
        warn: is told, while the bag is read, which transforms are left out.

    Raises:
        AtomError: neither bag nor description tells the transforms, or one cannot be read.
    """
    topics, sound = tf_topics(bag), SoundTransforms(warn)
    remarks = [topics.remark] if topics.remark else []
    if description is None and topics:
        transforms = BagTransforms(bag, sound=sound)
        joints = bag.topics_of([JOINT_STATE])
        if transforms.moving or not joints or _connects(transforms.at(0.0), config):
            return transforms, None, remarks
    file = _saved(config, config_file) if description in (None, SAVED) else str(description)
    if file is None and description is None:
        return BagTransforms(bag), None, remarks  # which refuses, and says what to do
    if file is None:
        raise TransformError(
            f"--description: neither {first_guess_file(config_file)} nor a description_file in "
            f"{config_file} is there; give the file: --description FILE"
        )
    described = DescribedEdges(bag, read_description(file).robot)
    if description is None:
        moved = f", moved by {', '.join(described.topics)}" if described.topics else ""
        without = "no /tf" if topics else "neither /tf nor /tf_static"
        remarks.append(f"the bag has {without}: its transforms are those of {file}{moved}")
    return BagTransforms(bag, DEFAULT_MAX_GAP_S, described, sound), described, remarks


def check_described(
    described: Optional[DescribedEdges],
    transforms: BagTransforms,
    rig: Rig,
    config: CalibrationConfig,
    time_s: float,
) -> None:
    """Refuse a bag that does not tell where a joint stands that a sensor or board hangs on.

    Raises:
        TransformError: naming the joint, what hangs on it, and the joints that the bag has.
    """
    if described is None:
        return
    needed = {f"sensor '{s.name}'": s.frame for s in rig.sensors.values()}
    for name, pattern in config.calibration_patterns.items():
        needed[f"pattern '{name}'"] = pattern.parent_link
    described.check(config.world_link, needed, transforms.at(time_s).placed)


def complete_from_s(
    transforms: BagTransforms,
    config: CalibrationConfig,
    start_s: float,
    warn: Callable[[str], None],
) -> float:
    """Return from when on a bag's transforms place all sensors and the boards' parents [s].

    A robot may have been started after the recording was. Where they are never complete it is the
    beginning, so that what is missing there is told.

    Args:
        transforms: of the bag.
        config: the calibration.
        start_s: when the recording begins [s].
        warn: is told where they begin later.
    """
    if _connects(transforms.at(start_s), config):
        return start_s
    for begin_s in transforms.begins_s():
        if begin_s > start_s and _connects(transforms.at(begin_s), config):
            warn(
                f"the transforms are complete {begin_s - start_s:.1f} s after the recording begins "
                f"only; what is before gives no collection"
            )
            return begin_s
    return start_s


def _connects(tree: TransformTree, config: CalibrationConfig) -> bool:
    """Tell whether a tree places all sensors and the boards' parents."""
    frames = [sensor.link for sensor in config.sensors.values()]
    frames += [pattern.parent_link for pattern in config.calibration_patterns.values()]
    try:
        for frame in frames:
            tree.path_here(config.world_link, frame)
    except TransformError:
        return False
    return True


def _saved(config: CalibrationConfig, config_file: Path) -> Optional[str]:
    file = first_guess_file(config_file)
    return str(file) if file.exists() else config.description_file


def first_guess_file(config_file: Path) -> Path:
    """Return where the package of a configuration has its first guess."""
    return config_file.absolute().parent.parent / FIRST_GUESS
