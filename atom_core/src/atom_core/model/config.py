"""The configuration of a calibration: ATOM's config.yml, version 3.

Names, units and meanings are ATOM's, so that files go both ways. Every dataclass checks its
values when it is made. What the suite does not know is kept in ``extra`` and written back.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Tuple, Union

from atom_core.errors import ConfigError
from atom_core.model.config_entries import (
    DICTIONARIES,
    JOINT_PARAMETERS,
    PATTERN_TYPES,
    EdgeConfig,
    JointConfig,
    PatternConfig,
    PriorConfig,
    SensorConfig,
)
from atom_core.model.config_section import (
    ConfigValueError,
    KeyPath,
    Section,
    check_frame,
    check_name,
    check_number,
    check_optional_text,
    choices,
    document_of,
    shown,
)
from atom_core.model.pattern import CHARUCO, CHESSBOARD
from atom_core.model.transforms import Edge

__all__ = [
    "DICTIONARIES",
    "JOINT_PARAMETERS",
    "PATTERN_TYPES",
    "CalibrationConfig",
    "ConfigValueError",
    "EdgeConfig",
    "JointConfig",
    "PatternConfig",
    "PriorConfig",
    "SensorConfig",
]

CURRENT_VERSION = 3.0
DEFAULT_MAX_DURATION_MS = 1000
_PATTERN_OF_VERSION_2 = "calibration_pattern"  # one, without a name
_NAME_OF_MIGRATED_PATTERN = "pattern_1"
GREATEST_SQUARE_M = 1.0
_NAMED_HERE = ("sensors", "calibration_patterns", "additional_tfs")  # joints: in the description
_MAPS = (*_NAMED_HERE, "joints", "priors")


@dataclass(frozen=True)
class CalibrationConfig:
    """A whole configuration.

    Attributes:
        world_link: root of the tree.
        sensors: by name, in the order of the file. Names may contain one another.
        calibration_patterns: by name.
        description_file: URI of the robot's description.
        bag_file: path of the bag.
        additional_tfs: further edges to be estimated, by name.
        joints: joints with parameters to be estimated, by the name in the description.
        anchored_sensor: sensor that is held still, None for none.
        max_duration_between_msgs: greatest difference of the stamps in a collection, in
            **milliseconds**, below 1 in seconds; use `max_duration_between_msgs_s` in
            computations.
        package_name: of the calibration package.
        priors: what is known beforehand, by the name of a sensor, an additional tf, a joint or a
            fixed pattern.
        version: of the format.
        extra: unknown keys.
        warnings: what the user should know, one line each.
    """

    KEYS = (
        *("description_file", "bag_file", "world_link", "sensors", "additional_tfs", "joints"),
        *("calibration_patterns", "anchored_sensor", "max_duration_between_msgs"),
        *("package_name", "version", "priors"),
    )

    world_link: str
    sensors: Mapping[str, SensorConfig]
    calibration_patterns: Mapping[str, PatternConfig]
    description_file: Optional[str] = None
    bag_file: Optional[str] = None
    additional_tfs: Mapping[str, EdgeConfig] = field(default_factory=dict)
    joints: Mapping[str, JointConfig] = field(default_factory=dict)
    anchored_sensor: Optional[str] = None
    max_duration_between_msgs: float = DEFAULT_MAX_DURATION_MS
    package_name: Optional[str] = None
    priors: Mapping[str, PriorConfig] = field(default_factory=dict)
    version: float = CURRENT_VERSION
    extra: Mapping[str, Any] = field(default_factory=dict)
    warnings: Tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        check_frame(self.world_link, "world_link")
        for key in ("description_file", "bag_file", "package_name", "anchored_sensor"):
            check_optional_text(getattr(self, key), key)
        check_number(self.max_duration_between_msgs, "max_duration_between_msgs", "ms", above=0)
        check_number(self.version, "version", "of the format, now 3.0", above=0)
        for key in _MAPS:
            _check_names(getattr(self, key), key)
            object.__setattr__(self, key, dict(getattr(self, key)))
        for key in ("sensors", "calibration_patterns"):
            if not getattr(self, key):
                raise ConfigValueError("is empty; at least one entry is needed", key)
        self._check_anchor()
        self._check_one_parent_per_frame()
        self._check_additional_tfs()
        self._check_frames_of_boards()

    @property
    def estimated_edges(self) -> Tuple[Tuple[str, Edge], ...]:
        """Name and edge of every sensor and every additional tf."""
        entries: Tuple[Tuple[str, Union[SensorConfig, EdgeConfig]], ...] = (
            *self.sensors.items(),
            *self.additional_tfs.items(),
        )
        return tuple((name, entry.edge) for name, entry in entries)

    @property
    def max_duration_between_msgs_s(self) -> float:
        """Greatest difference of the stamps in a collection [s].

        No recording is exact to parts of a millisecond: below 1 the number is in seconds, as
        ATOM compares it.
        """
        number = self.max_duration_between_msgs
        return number if number < 1 else number / 1000.0

    @classmethod
    def from_document(
        cls,
        document: Mapping[str, Any],
        where: str,
        locate: Optional[Callable[[KeyPath], str]] = None,
    ) -> CalibrationConfig:
        """Read the content of a config.yml, or the copy inside a dataset.

        Tolerated: absent optional keys, empty text for null, and the single
        ``calibration_pattern`` of version 2, which becomes ``calibration_patterns.pattern_1``.

        Args:
            document: plain maps, lists, texts and numbers.
            where: what messages call it (the file).
            locate: returns the place of a key path (the file and line); `where` if not given.

        Returns:
            The configuration; its ``warnings`` tell of unknown keys and of what was migrated.

        Raises:
            ConfigError: one line with the place, the key and the remedy.
        """
        place = locate or (lambda _path: where)
        try:
            root = Section(document, _known_keys(document))
            config = _read(cls, root)
            config._check_priors()
        except ConfigValueError as error:
            dotted = ".".join(error.key_path) or "the configuration"
            raise ConfigError(f"{place(error.key_path)}: {dotted} {error.problem}") from None
        remarks = [*root.remarks, *_advice(config)]
        lines = tuple(f"{place(path)}: {'.'.join(path)} {text}" for path, text in remarks)
        object.__setattr__(config, "warnings", lines)
        return config

    def to_document(self) -> Dict[str, Any]:
        """Return the configuration as plain values, every key of ATOM's template included."""
        document = document_of(self, self.KEYS)
        for key in _MAPS:
            entries = {name: entry.to_document() for name, entry in getattr(self, key).items()}
            document[key] = entries or None
        if not self.priors:  # which ATOM does not know
            del document["priors"]
        return document

    def _check_anchor(self) -> None:
        anchor = self.anchored_sensor
        if anchor is not None and anchor not in self.sensors:
            raise ConfigValueError(
                f"is {shown(anchor)}, which is no sensor; use {choices(list(self.sensors))}, or "
                f"leave it empty",
                "anchored_sensor",
            )

    def _check_priors(self) -> None:
        fixed = [name for name, pattern in self.calibration_patterns.items() if pattern.fixed]
        there = [*self.sensors, *self.additional_tfs, *self.joints, *fixed]
        for name in self.priors:
            if name not in there:
                raise ConfigValueError(
                    f"is of no sensor, additional tf, joint or fixed pattern; use {choices(there)}",
                    ("priors", name),
                )

    def _check_frames_of_boards(self) -> None:
        """Refuse boards whose frame is that of a sensor, or of another board."""
        owners = {entry.child_link: f"child_link of '{path[-1]}'" for path, entry in _edges(self)}
        owners.update({entry.link: f"link of '{name}'" for name, entry in self.sensors.items()})
        for name, pattern in self.calibration_patterns.items():
            if pattern.link in owners:
                raise ConfigValueError(
                    f"is {shown(pattern.link)}, the {owners[pattern.link]}; give the board a frame "
                    f"of its own",
                    ("calibration_patterns", name, "link"),
                )
            owners[pattern.link] = f"link of '{name}'"

    def _check_one_parent_per_frame(self) -> None:
        parents: Dict[str, Tuple[str, str]] = {}
        for path, entry in _edges(self):
            parent, owner = parents.setdefault(entry.child_link, (entry.parent_link, path[-1]))
            if parent != entry.parent_link:
                raise ConfigValueError(
                    f"is {shown(entry.parent_link)}, but '{owner}' hangs the same child_link "
                    f"{shown(entry.child_link)} on {shown(parent)}; a frame has one parent",
                    (*path, "parent_link"),
                )

    def _check_additional_tfs(self) -> None:
        """Refuse two additional tfs that are one transform; one that is a sensor's may stand."""
        owners: Dict[str, str] = {}
        for name, entry in self.additional_tfs.items():
            owner = owners.setdefault(entry.child_link, name)
            if owner != name:
                raise ConfigValueError(
                    f"is the transform {entry.edge}, as '{owner}' is; leave one of the two out",
                    ("additional_tfs", name),
                )


def _known_keys(document: Any) -> Tuple[str, ...]:
    """Return the keys of version 3, and that of version 2 where it stands in their place."""
    keys = CalibrationConfig.KEYS
    if not isinstance(document, Mapping) or _PATTERN_OF_VERSION_2 not in document:
        return keys
    in_their_place = document.get("calibration_patterns") in (None, "")
    return (*keys, _PATTERN_OF_VERSION_2) if in_their_place else keys


def _read(cls: Callable[..., CalibrationConfig], root: Section) -> CalibrationConfig:
    patterns, migrated = _read_patterns(root)
    return cls(
        world_link=root.require("world_link", "the root frame of the tree"),
        sensors={
            n: SensorConfig.from_section(s) for n, s in root.named("sensors", SensorConfig.KEYS)
        },
        calibration_patterns=patterns,
        description_file=root.get("description_file"),
        bag_file=root.get("bag_file"),
        additional_tfs={
            n: EdgeConfig.from_section(s) for n, s in root.named("additional_tfs", EdgeConfig.KEYS)
        },
        joints={n: JointConfig.from_section(s) for n, s in root.named("joints", JointConfig.KEYS)},
        anchored_sensor=root.get("anchored_sensor"),
        max_duration_between_msgs=_number(
            root, "max_duration_between_msgs", DEFAULT_MAX_DURATION_MS
        ),
        package_name=root.get("package_name"),
        priors={n: PriorConfig.from_section(s) for n, s in root.named("priors", PriorConfig.KEYS)},
        version=CURRENT_VERSION if migrated else _number(root, "version", CURRENT_VERSION),
        extra=root.extra(),
    )


def _number(root: Section, key: str, default: float) -> Any:
    """Return a value; a number that stands in quotes is a number, as it is to ATOM."""
    value = root.get(key, default)
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _read_patterns(root: Section) -> Tuple[Dict[str, PatternConfig], bool]:
    """Return the patterns by name, and whether they came in the layout of version 2."""
    if not root.knows(_PATTERN_OF_VERSION_2):
        entries = root.named("calibration_patterns", PatternConfig.KEYS)
        return {name: PatternConfig.from_section(entry) for name, entry in entries}, False
    root.remark(
        f"is the layout of version 2; it is read, and written when saved, as "
        f"calibration_patterns.{_NAME_OF_MIGRATED_PATTERN}",
        _PATTERN_OF_VERSION_2,
    )
    entry = root.section(_PATTERN_OF_VERSION_2, PatternConfig.KEYS)
    return {_NAME_OF_MIGRATED_PATTERN: PatternConfig.from_section(entry)}, True


def key_path_as_written(document: Any, key_path: KeyPath) -> KeyPath:
    """Return where a key stands in a document, which may have the layout of version 2."""
    migrated = ("calibration_patterns", _NAME_OF_MIGRATED_PATTERN)
    if key_path[:2] == migrated and _PATTERN_OF_VERSION_2 in document:
        return (_PATTERN_OF_VERSION_2, *key_path[2:])
    return key_path


def _check_names(entries: Any, key: str) -> None:
    if not isinstance(entries, Mapping):
        raise ConfigValueError(f"is {shown(entries)}; write a map, 'name: ...' lines", key)
    for name in entries:
        if not isinstance(name, str) or not name.strip():
            raise ConfigValueError(f"has the name {shown(name)}; write a text", key)
        if key in _NAMED_HERE:
            check_name(name, (key, name))


def _edges(
    config: CalibrationConfig,
) -> Iterator[Tuple[KeyPath, Union[SensorConfig, EdgeConfig]]]:
    """Yield (key path, entry) of all edges that are estimated."""
    for name, sensor in config.sensors.items():
        yield ("sensors", name), sensor
    for name, edge in config.additional_tfs.items():
        yield ("additional_tfs", name), edge


def _advice(config: CalibrationConfig) -> List[Tuple[KeyPath, str]]:
    """Return (key path, text) of what may be used but is probably not meant."""
    advice: List[Tuple[KeyPath, str]] = []
    if config.max_duration_between_msgs < 1:
        number = config.max_duration_between_msgs
        text = f"is {number:g} and read as seconds; write {1000 * number:g} (milliseconds)"
        advice.append((("max_duration_between_msgs",), text))
    if not 2 <= config.version < 4:
        text = f"is {config.version}; this program knows version {CURRENT_VERSION}"
        advice.append((("version",), text))
    for name, pattern in config.calibration_patterns.items():
        path = ("calibration_patterns", name)
        if pattern.size > GREATEST_SQUARE_M:
            text = (
                f"is {pattern.size} metres for one square; is it meant in millimetres? Sizes are "
                f"in metres"
            )
            advice.append(((*path, "size"), text))
        elif max(pattern.border_sides) > GREATEST_SQUARE_M:
            text = (
                f"has a side of {max(pattern.border_sides):g} metres; is it meant in millimetres? "
                f"Sizes are in metres"
            )
            advice.append(((*path, "border" if pattern.border else "border_size"), text))
        if pattern.pattern_type == CHESSBOARD and sum(pattern.dimension) % 2 == 0:
            text = (
                "makes a board that looks the same upside down, so that its pose is ambiguous; "
                "use an odd and an even number of corners, or a charuco"
            )
            advice.append(((*path, "dimension"), text))
    alike = (*_advice_on_dictionaries(config), *_advice_on_chessboards(config))
    return [*advice, *alike, *_advice_on_shared_edges(config)]


def _advice_on_dictionaries(config: CalibrationConfig) -> Iterator[Tuple[KeyPath, str]]:
    """Small dictionaries are the beginning of the large ones of the same bits."""
    first: Dict[str, str] = {}
    for name, pattern in config.calibration_patterns.items():
        if pattern.pattern_type == CHARUCO and pattern.dictionary is not None:
            bits = pattern.dictionary.rsplit("_", 1)[0]
            other = first.setdefault(bits, name)
            if other != name:
                yield (
                    ("calibration_patterns", name, "dictionary"),
                    f"has the same markers as '{other}': where a camera sees both boards they "
                    f"cannot be told apart; use a dictionary with another number of bits",
                )


def _advice_on_chessboards(config: CalibrationConfig) -> Iterator[Tuple[KeyPath, str]]:
    first: Dict[Tuple[int, ...], str] = {}
    for name, pattern in config.calibration_patterns.items():
        if pattern.pattern_type == CHESSBOARD:
            other = first.setdefault(tuple(sorted(pattern.dimension)), name)
            if other != name:
                yield (
                    ("calibration_patterns", name, "dimension"),
                    f"is that of '{other}': where a camera sees one of the two boards it cannot "
                    f"tell which; use one with another number of corners, or a charuco",
                )


def _advice_on_shared_edges(config: CalibrationConfig) -> Iterator[Tuple[KeyPath, str]]:
    first: Dict[str, KeyPath] = {}
    for path, entry in _edges(config):
        other = first.setdefault(entry.child_link, path)
        if other != path:
            yield path, f"shares its edge with {'.'.join(other)}: there is one estimate for both"
