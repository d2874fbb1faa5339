"""The entries of a configuration: sensors, further edges, joints and patterns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, Optional, Tuple, Union

from atom_core.model.config_border import (
    BORDER,
    SIDES,
    check_each,
    read_border,
    read_pair,
    read_sides,
)
from atom_core.model.config_section import (
    ConfigValueError,
    Section,
    check_choice,
    check_flag,
    check_frame,
    check_number,
    check_optional_text,
    check_topic,
    choices,
    document_of,
    shown,
)
from atom_core.model.joints import JOINT_PARAMETERS
from atom_core.model.modality import modalities, modality_named
from atom_core.model.pattern import CHARUCO, CHESSBOARD
from atom_core.model.sensor import WIDEST_BEAM_RAD
from atom_core.model.transforms import Edge

_MOST_IN_A_ROW = 1000  # corners of a board; no camera sees as many
LEAST_SIDE_M, MOST_SIDE_M, MOST_RATIO = 1e-3, 1e3, 1e3  # of a board, as in board_segmentation.cpp
PATTERN_TYPES = (CHESSBOARD, CHARUCO)
AUTO = "auto"
DICTIONARIES = tuple(
    f"DICT_{bits}_{count}"
    for bits in ("4X4", "5X5", "6X6", "7X7")
    for count in (50, 100, 250, 1000)
)


@dataclass(frozen=True)
class EdgeConfig:
    """An edge of the transform tree that is estimated besides the sensors' own.

    Attributes:
        parent_link: frame in which it is given.
        child_link: frame whose pose it is.
        extra: unknown keys.
    """

    KEYS = ("parent_link", "child_link")

    parent_link: str
    child_link: str
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_edge(self.parent_link, self.child_link, "child_link")

    @property
    def edge(self) -> Edge:
        """The edge from parent to child."""
        return Edge(self.parent_link, self.child_link)

    @classmethod
    def from_section(cls, section: Section) -> EdgeConfig:
        """Read one entry of ``additional_tfs``."""
        return section.build(
            cls,
            parent_link=section.require("parent_link", "the frame the edge starts from"),
            child_link=section.require("child_link", "the frame whose pose is estimated"),
            extra=section.extra(),
        )

    def to_document(self) -> Dict[str, Any]:
        """Return the entry as plain values."""
        return document_of(self, self.KEYS)


@dataclass(frozen=True)
class PriorConfig:
    """What is known of a sensor's edge, an additional tf or a joint beforehand.

    Attributes:
        sigma_m, sigma_rad: standard deviations about the described value.
        extra: unknown keys.
    """

    KEYS = ("sigma_m", "sigma_rad")

    sigma_m: float
    sigma_rad: float
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_number(self.sigma_m, "sigma_m", "metres", above=0)
        check_number(self.sigma_rad, "sigma_rad", "radians", above=0)

    @classmethod
    def from_section(cls, section: Section) -> PriorConfig:
        """Read one entry of ``priors``."""
        return section.build(
            cls,
            sigma_m=section.require("sigma_m", "the standard deviation of each length, in metres"),
            sigma_rad=section.require("sigma_rad", "that of each angle, in radians"),
            extra=section.extra(),
        )

    def to_document(self) -> Dict[str, Any]:
        """Return the entry as plain values."""
        return document_of(self, self.KEYS)


@dataclass(frozen=True)
class SensorConfig:
    """A sensor: its data, and the edge that is estimated for it.

    Attributes:
        link: frame of its data (header.frame_id).
        parent_link: frame in which its pose is estimated.
        child_link: frame whose pose is estimated; parent to child is one fixed edge of the
            description, between the world and `link`.
        topic_name: raw topic (compressed images: without ``/compressed``).
        modality: name of a registered modality; None: to be told from the type of the messages.
        throttle: rate at which messages are passed on when a bag is played [Hz], None for all.
        beam_width: full angle of a 3D LiDAR's beams [rad], None for point-like ones.
        extra: unknown keys.
    """

    KEYS = ("link", "parent_link", "child_link", "topic_name", "modality", "throttle", "beam_width")

    link: str
    parent_link: str
    child_link: str
    topic_name: str
    modality: Optional[str] = None
    throttle: Optional[float] = None
    beam_width: Optional[float] = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_frame(self.link, "link")
        _check_edge(self.parent_link, self.child_link, "child_link")
        check_topic(self.topic_name, "topic_name")
        if self.modality is not None:
            check_choice(self.modality, "modality", [m.name for m in modalities()])
        if self.throttle is not None:
            check_number(self.throttle, "throttle", "Hz", above=0)
        if self.beam_width is not None:
            self._check_beam_width(self.beam_width)

    def _check_beam_width(self, width: float) -> None:
        check_number(width, "beam_width", "rad", at_least=0)
        if width > WIDEST_BEAM_RAD:
            raise ConfigValueError(
                f"is {width:g} rad, wider than any beam ({WIDEST_BEAM_RAD:g}); write radians, "
                f"0.01 is half a degree",
                "beam_width",
            )
        if self.modality is not None and modality_named(self.modality).beam_width is None:
            raise ConfigValueError(
                f"is given for a sensor of modality {self.modality}; it is of 3D LiDARs, remove it",
                "beam_width",
            )

    @property
    def edge(self) -> Edge:
        """The edge that is estimated."""
        return Edge(self.parent_link, self.child_link)

    @classmethod
    def from_section(cls, section: Section) -> SensorConfig:
        """Read one entry of ``sensors``."""
        return section.build(
            cls,
            link=section.require("link", "the frame of the data (header.frame_id)"),
            parent_link=section.require("parent_link", "the frame its pose is estimated in"),
            child_link=section.require("child_link", "the frame whose pose is estimated"),
            topic_name=section.require("topic_name", "the topic of the sensor's data"),
            modality=section.get("modality"),
            throttle=section.get("throttle"),
            beam_width=section.get("beam_width"),
            extra=section.extra(),
        )

    def to_document(self) -> Dict[str, Any]:
        """Return the entry as plain values."""
        keys = [key for key in self.KEYS if key != "beam_width" or self.beam_width is not None]
        return document_of(self, keys)


@dataclass(frozen=True)
class JointConfig:
    """A joint of the robot with parameters to be estimated.

    Attributes:
        params_to_calibrate: some of `JOINT_PARAMETERS`.
        extra: unknown keys.
    """

    KEYS = ("params_to_calibrate",)

    params_to_calibrate: Tuple[str, ...]
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        key, values = "params_to_calibrate", self.params_to_calibrate
        if not isinstance(values, (list, tuple)):
            raise ConfigValueError(f"is {shown(values)}; write a list, e.g. [origin_yaw]", key)
        if not values:
            raise ConfigValueError("is an empty list; name parameters or remove the joint", key)
        for index, value in enumerate(values):
            if value not in JOINT_PARAMETERS:
                problem = f"holds {shown(value)}; use {choices(JOINT_PARAMETERS)}"
                raise ConfigValueError(problem, key)
            if value in values[:index]:
                raise ConfigValueError(f"names {value} twice; remove one", key)
        object.__setattr__(self, key, tuple(values))

    @classmethod
    def from_section(cls, section: Section) -> JointConfig:
        """Read one entry of ``joints``."""
        parameters = section.require("params_to_calibrate", "a list, e.g. [origin_yaw]")
        return section.build(cls, params_to_calibrate=parameters, extra=section.extra())

    def to_document(self) -> Dict[str, Any]:
        """Return the entry as plain values."""
        document = document_of(self, self.KEYS)
        document["params_to_calibrate"] = list(self.params_to_calibrate)
        return document


@dataclass(frozen=True)
class PatternConfig:
    """A calibration pattern.

    Attributes:
        link: frame of the board.
        parent_link: frame in which its pose is estimated.
        fixed: True: one pose for all collections; False: one per collection.
        pattern_type: chessboard or charuco.
        dimension: numbers of inner corners along (x, y) = (columns, rows).
        size: side of a square [m].
        border_size: (x, y) from the outermost squares' edges to the board's edges [m]; one number
            may be given for both. Not used where ``border`` is given.
        inner_size: side of a marker (charuco) [m].
        dictionary: of the markers (charuco).
        mesh_file: URI of a mesh for the description with boards; see `io.urdf_boards`.
        legacy: layout of a charuco with an even number of rows of squares: True, as OpenCV before
            4.6 printed it; False, as since; "auto", whichever the pictures show.
        border: (left, right, top, bottom) in place of border_size, for a print that is not in the
            middle of its board: at the smaller x, the larger x, the smaller y, the larger y [m].
        extra: unknown keys.
        border_is_number: border_size was given as one number, and is written so.
    """

    KEYS = (
        *("link", "parent_link", "fixed", "pattern_type", "dictionary", "mesh_file"),
        *("border_size", "border", "dimension", "size", "inner_size", "legacy"),
    )

    link: str
    parent_link: str
    fixed: bool
    pattern_type: str
    dimension: Tuple[int, int]
    size: float
    border_size: Tuple[float, float] = (0.0, 0.0)
    inner_size: Optional[float] = None
    dictionary: Optional[str] = None
    mesh_file: Optional[str] = None
    legacy: Union[bool, str] = AUTO
    border: Optional[Tuple[float, float, float, float]] = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    border_is_number: bool = field(default=False, compare=False)

    def __post_init__(self) -> None:
        _check_edge(self.parent_link, self.link, "link")
        check_flag(self.fixed, "fixed", "does the board stay where it is in all collections?")
        check_choice(self.pattern_type, "pattern_type", PATTERN_TYPES)
        object.__setattr__(self, "dimension", _checked_dimension(self.dimension))
        check_number(self.size, "size", "side of a square in metres", above=0)
        self._check_border()
        check_optional_text(self.mesh_file, "mesh_file")
        if not isinstance(self.legacy, bool) and self.legacy != AUTO:
            raise ConfigValueError(
                f"is {shown(self.legacy)}; write true, false or auto, without quotes", "legacy"
            )
        if self.pattern_type == CHARUCO:
            self._check_markers()
        else:  # ATOM's template fills these in for a chessboard too; they mean nothing there
            check_optional_text(self.dictionary, "dictionary")

    @property
    def border_sides(self) -> Tuple[float, float, float, float]:
        """Widths of the border (left, right, top, bottom) [m], however they were given."""
        if self.border is not None:
            return self.border
        x, y = self.border_size
        return (x, x, y, y)

    @property
    def marker_count(self) -> int:
        """Number of markers of a charuco: every other square has one."""
        columns, rows = self.dimension
        return (columns + 1) * (rows + 1) // 2

    @classmethod
    def from_section(cls, section: Section) -> PatternConfig:
        """Read one entry of ``calibration_patterns``."""
        return section.build(
            cls,
            link=section.require("link", "the frame of the board"),
            parent_link=section.require("parent_link", "the frame its pose is estimated in"),
            fixed=section.require("fixed", "true if the board stays where it is, else false"),
            pattern_type=section.require("pattern_type", choices(PATTERN_TYPES)),
            dimension=read_pair(section, "dimension", "the number of inner corners"),
            size=section.require("size", "the side of a square in metres"),
            border_size=read_border(section),
            inner_size=section.get("inner_size"),
            dictionary=section.get("dictionary"),
            mesh_file=section.get("mesh_file"),
            legacy=AUTO if section.get("legacy") is None else section.get("legacy"),
            border=read_sides(section),
            extra=section.extra(),
        )

    def to_document(self) -> Dict[str, Any]:
        """Return the entry as plain values."""
        document = document_of(self, self.KEYS)
        if self.legacy == AUTO:  # ATOM does not know the key
            del document["legacy"]
        document["dimension"] = dict(zip("xy", self.dimension))
        as_number = self.border_is_number and self.border_size[0] == self.border_size[1]
        document["border_size"] = (
            self.border_size[0] if as_number else dict(zip("xy", self.border_size))
        )
        del document["border" if self.border is None else "border_size"]  # one of them is given
        if self.border is not None:
            document["border"] = dict(zip(SIDES, self.border))
        return document

    def _check_border(self) -> None:
        if not isinstance(self.border_size, tuple):
            check_number(self.border_size, "border_size", f"{BORDER}, or {{x: , y: }}", at_least=0)
            object.__setattr__(self, "border_size", (self.border_size, self.border_size))
            object.__setattr__(self, "border_is_number", True)
        check_each(self.border_size, "border_size", "xy")
        if self.border is not None:
            check_each(self.border, "border", SIDES)
        left, right, top, bottom = self.border_sides
        columns, rows = self.dimension
        width = (columns + 1) * self.size + left + right
        height = (rows + 1) * self.size + top + bottom
        least, most = (min(columns, rows) + 1) * self.size, max(width, height)
        if not (least >= LEAST_SIDE_M and most <= min(MOST_SIDE_M, MOST_RATIO * least)):
            problem = f"is {self.size:g}, the board {width:.3g} x {height:.3g} m; write metres"
            raise ConfigValueError(problem, "size")

    def _check_markers(self) -> None:
        if self.inner_size is None:
            raise ConfigValueError("is absent; give the side of a marker in metres", "inner_size")
        check_number(self.inner_size, "inner_size", "side of a marker in metres", above=0)
        if self.inner_size >= self.size:
            problem = f"is {self.inner_size}; a marker is smaller than its square ({self.size} m)"
            raise ConfigValueError(problem, "inner_size")
        if self.dictionary is None:
            raise ConfigValueError(f"is absent; use {choices(DICTIONARIES)}", "dictionary")
        check_choice(self.dictionary, "dictionary", DICTIONARIES)
        available = int(self.dictionary.rsplit("_", 1)[1])
        if self.marker_count > available:
            columns, rows = self.dimension
            raise ConfigValueError(
                f"is {self.dictionary} with {available} markers, but {columns + 1} x {rows + 1} "
                f"squares need {self.marker_count}; check dimension (inner corners) and dictionary",
                "dictionary",
            )


def _check_edge(parent: Any, child: Any, child_key: str) -> None:
    check_frame(parent, "parent_link")
    check_frame(child, child_key)
    if parent == child:
        problem = f"is {shown(child)} like parent_link; an edge joins two frames"
        raise ConfigValueError(problem, child_key)


def _checked_dimension(dimension: Any) -> Tuple[int, ...]:
    if not isinstance(dimension, (tuple, list)) or len(dimension) != 2:
        raise ConfigValueError(f"is {shown(dimension)}; give (columns, rows)", "dimension")
    for axis, count in zip("xy", dimension):
        whole = isinstance(count, int) or (isinstance(count, float) and count.is_integer())
        if isinstance(count, bool) or not whole or not 2 <= count <= _MOST_IN_A_ROW:
            problem = (
                f"is {shown(count)}; write the number of inner corners, at least 2 and at most "
                f"{_MOST_IN_A_ROW}"
            )
            raise ConfigValueError(problem, ("dimension", axis))
    return tuple(int(count) for count in dimension)
