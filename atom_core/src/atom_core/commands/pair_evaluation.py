"""ATOM's evaluations of one pair of sensors, as data; each is a short form of ``evaluate``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from atom_core.calibration.prepare.input_changes import without_partial_detections
from atom_core.commands import common
from atom_core.commands.annotated_borders import annotated_borders
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.errors import DatasetError, OutputError
from atom_core.evaluation.between_collections import between_collections, moves_of_frame
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.mixed import mixed_dataset
from atom_core.evaluation.observed import Borders, Observed
from atom_core.evaluation.own_edges import own_edges
from atom_core.evaluation.pairs import Pair, pair_kinds
from atom_core.evaluation.results import PairResult
from atom_core.geometry.units import MM_PER_M
from atom_core.io.atomic import write_text_atomically
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset, is_complete
from atom_core.model.selection import select_names
from atom_core.model.sensor import RGB
from atom_core.report.atom_csv import csv_text
from atom_core.report.tables import AVERAGES, text_table

_DECIMALS = 4
_NOT_HERE = (
    AtomOption(
        *("si", "show_images"),
        remark="nothing is drawn; docs/evaluation.md tells how the distances are measured",
    ),
    AtomOption("bt", "border_tolerance", "0.025", remark="the border is clipped to the image"),
    AtomOption(
        *("ua", "use_annotation"),
        remark="annotations of the border are used wherever they lie beside the test set",
    ),
)


class Evaluator(NamedTuple):
    """A command of ATOM that evaluates one pair.

    Attributes:
        name: of the command.
        kind: of the pair, as in ``evaluation.json``.
        source, target: short and long names of the options that name the sensors.
        between: the source of one collection is compared with the target of another one.
    """

    name: str
    kind: str
    source: Tuple[str, str]
    target: Tuple[str, str]
    between: bool = False

    @property
    def column(self) -> str:
        """Header of ATOM's first column."""
        in_pairs = self.between and self.kind in ("lidar3d-rgb", "lidar3d-lidar3d")
        return "Collection Pair" if in_pairs else "Collection #"


_SENSORS = ("ss", "sensor_source"), ("st", "sensor_target")
_RANGE, _DEPTH, _CAMERA = ("rs", "range_sensor"), ("ds", "depth_sensor"), ("cs", "camera_sensor")
_IN_ONE = (
    Evaluator("rgb_to_rgb_evaluation", "rgb-rgb", *_SENSORS),
    Evaluator("lidar_to_rgb_evaluation", "lidar3d-rgb", _RANGE, _CAMERA),
    Evaluator("lidar_to_depth_evaluation", "lidar3d-depth", _RANGE, _DEPTH),
    Evaluator("depth_to_rgb_evaluation", "depth-rgb", _DEPTH, _CAMERA),
    Evaluator("depth_to_depth_evaluation", "depth-depth", *_SENSORS),
    Evaluator("lidar_to_lidar_evaluation", "lidar3d-lidar3d", *_SENSORS),
)
_BETWEEN = [e._replace(name=f"inter_collection_{e.name}", between=True) for e in _IN_ONE]
EVALUATORS = {evaluator.name: evaluator for evaluator in (*_IN_ONE, *_BETWEEN)}


def example(name: str) -> str:
    """Return a command line of an evaluator."""
    tool = EVALUATORS[name]
    return (
        f"python3 -m atom_core {name} -train_json atom_calibration.json -test_json dataset.json "
        f"-{tool.source[0]} A -{tool.target[0]} B -sfr"
    )


def adder(name: str) -> Callable[[argparse.ArgumentParser], None]:
    """Return what adds an evaluator's options."""

    def add_arguments(parser: argparse.ArgumentParser) -> None:
        add = common.add_option
        for option in ("train_json", "test_json"):
            help_text = f"the {'calibrated ' if 'train' in option else 'test '}dataset"
            add(parser, option, f"-{option}", required=True, type=Path, metavar="F", help=help_text)
        tool = EVALUATORS[name]
        for dest, (short, long) in (("source", tool.source), ("target", tool.target)):
            names = (f"-{short}", f"--{long}")
            add(parser, dest, *names, required=True, metavar="SENSOR", help=f"the {dest}")
        texts = {"-csf": "collection_selection_function", "-pn": "pattern_name"}
        for short, option in texts.items():
            add(parser, option, short, nargs="+", metavar="SELECTION", help="only these")
        if tool.between:
            what = "in which the board stays (default: the pattern's parent_link)"
            add(parser, "fixed_frame", "-wf", metavar="FRAME", help=what)
        add_common_options(parser)
        add_meaningless_options(parser, _NOT_HERE)

    return add_arguments


def add_common_options(parser: argparse.ArgumentParser) -> None:
    """Add what ATOM's evaluations of labels have in common."""
    flags = {
        "-uic": ("use_incomplete_collections", "also where not all sensors see all patterns"),
        "-rpd": ("remove_partial_detections", "without labels of cameras that lack corners"),
    }
    for short, (option, what) in flags.items():
        common.add_option(parser, option, short, action="store_true", help=what)
    add_results_options(parser)


def add_results_options(parser: argparse.ArgumentParser, may_have_value: bool = False) -> None:
    """Add where a table goes as CSV.

    Args:
        parser: of the command.
        may_have_value: ATOM's -sfr has a value there, which it never uses.
    """
    add, what = common.add_option, "write the table as CSV"
    kind: Dict[str, Any] = {"action": "store_true"}
    if may_have_value:
        kind = {"nargs": "?", "const": True, "default": False, "metavar": "IGNORED"}
    add(parser, "save_file_results", "-sfr", help=what, **kind)
    add(parser, "save_file_results_name", "-sfrn", type=Path, metavar="FILE", help="its name")
    common.add_overwrite_option(parser, "replace that file")


def runner(name: str) -> Callable[[argparse.Namespace], int]:
    """Return what runs an evaluator."""

    def run(args: argparse.Namespace) -> int:
        tool = EVALUATORS[name]
        beginning = "inter_collection_" if tool.between else ""
        target = results_file(args, f"{beginning}{args.source}_to_{args.target}_results.csv")
        measured = _measured_between if tool.between else _measured
        headers, rows = _table(measured(tool, args), tool.column)
        show_table(headers, rows, f"{args.source} to {args.target}", target)
        return 0

    return run


def results_file(args: argparse.Namespace, name: str) -> Optional[Path]:
    """Return where a table goes as CSV, if it was asked for: to `results/` beside the test set.

    Raises:
        OutputError: the file exists, and nothing says that it may be replaced.
    """
    if not args.save_file_results and not args.save_file_results_name:
        return None
    stem = args.train_json.name.partition(".")[0]
    usual = args.test_json.parent / "results" / f"{stem}_{name}"
    target = Path(args.save_file_results_name or usual)
    if target.exists() and not args.overwrite:
        raise OutputError(f"{target}: exists already; add --overwrite, or another -sfrn FILE")
    return target


def show_table(
    headers: List[str], rows: List[List[Any]], title: str, target: Optional[Path]
) -> None:
    """Print a table, and write it where it was asked for."""
    print(text_table(headers, rows, title, _DECIMALS))
    if target is not None:
        target.parent.mkdir(parents=True, exist_ok=True)
        write_text_atomically(target, csv_text(headers, rows, _DECIMALS, absent=""))
        print(f"\nresults: {target}")


def _measured(tool: Evaluator, args: argparse.Namespace) -> PairResult:
    train, test = read_dataset(args.train_json), test_set(args, [args.source, args.target])
    evaluation = evaluate(
        train,
        test,
        sensors=[s for s in test.sensors if s in (args.source, args.target)],
        pairs=[f"{args.source}:{args.target}"],
        annotations=_annotations(args, test),
    )
    of_kind = [result for result in evaluation.pairs if result.pair.kind.name == tool.kind]
    ends = args.source, args.target
    found = [r for r in of_kind if (r.pair.source, r.pair.target) == ends] or of_kind
    if not found or found[0].measured is None:
        why = found[0].skipped if found else f"they are no pair of {tool.kind}"
        pair = " to ".join(f"'{end}'" for end in ends)
        raise DatasetError(f"{args.test_json}: {pair} cannot be measured: {why}")
    return found[0]


def _measured_between(tool: Evaluator, args: argparse.Namespace) -> PairResult:
    """Return the figures of a pair between collections; source and target may be one sensor."""
    train, test = read_dataset(args.train_json), test_set(args, [args.source, args.target])
    (kind,) = (kind for kind in pair_kinds() if kind.name == tool.kind)
    named = f"'{args.source}' to '{args.target}'"
    if [test.sensors[s].modality for s in (args.source, args.target)] != [kind.source, kind.target]:
        raise DatasetError(
            f"{args.test_json}: {named} cannot be measured: they are no pair of {tool.kind}"
        )
    mixed = mixed_dataset(train, test, [args.source, args.target])
    observed = Observed(mixed, _annotations(args, test))
    pair = Pair(kind, args.source, args.target)
    own = own_edges(train, test)
    result = between_collections(pair, observed, mixed, frame=args.fixed_frame, own=own)
    if result.measured is None:
        raise DatasetError(f"{args.test_json}: {named} cannot be measured: {result.skipped}")
    for sentence in moves_of_frame(mixed, args.fixed_frame) if args.fixed_frame else ():
        print(f"warning: {sentence}")
    return result


def _annotations(args: argparse.Namespace, test: Dataset) -> Borders:
    """Return the borders drawn in the test set's images; warn of those in doubt."""
    annotations, doubts = annotated_borders(args.test_json, test, (args.source, args.target))
    for sentence in doubts:
        print(f"warning: {sentence}")
    return annotations


def test_set(args: argparse.Namespace, sensors: Sequence[str] = ()) -> Dataset:
    """Read the test set and reduce it as ATOM does: complete collections, unless -uic is given.

    A label that lacks corners does not make a collection incomplete, also where it is not used.

    Raises:
        DatasetError: it lacks one of some sensors, or no collection is complete.
    """

    def choose(keys: Any) -> List[str]:
        return select_names(keys, args.collection_selection_function, "collection")

    test = read_dataset(args.test_json, choose)
    for name in sensors:
        if name not in test.sensors:
            raise DatasetError(
                f"{args.test_json}: there is no sensor '{name}'; there are: "
                f"{', '.join(test.sensors)}"
            )
    if not args.use_incomplete_collections:
        complete = [key for key in test.collections if is_complete(test, key)]
        if not complete:
            raise DatasetError(
                f"{args.test_json}: in no collection all sensors see all patterns; add -uic"
            )
        test = test.selected(collections=complete)
    if args.remove_partial_detections:
        test, _ = without_partial_detections(test, sensors or None)
    return test.selected(patterns=select_names(test.patterns, args.pattern_name, "pattern"))


def _table(result: PairResult, column: str) -> Tuple[List[str], List[List[Any]]]:
    """Return ATOM's columns: a line for each collection and the means."""
    measured, kind = result.measured, result.pair.kind
    assert measured is not None
    in_metres = kind.unit != "px"
    unit, factor = ("m", 1.0 / MM_PER_M) if in_metres else ("pix", 1.0)
    columns: Dict[str, Tuple[str, float]] = {f"RMS ({unit})": ("rms", factor)}
    along = {"err": "mean"} if kind.target == RGB else {"err": "mean", "StDev": "std"}
    for header, figure in along.items():
        for axis in "xy":
            columns[f"{axis.upper()} {header} ({unit})"] = f"{axis}_{figure}_abs", factor
    if measured.translation_mm is not None:
        columns["Trans (mm)"], columns["Rot (deg)"] = ("translation_mm", 1.0), ("rotation_deg", 1.0)

    def cells(figures: Any) -> List[Optional[float]]:
        values = [(getattr(figures, name), scale) for name, scale in columns.values()]
        return [None if value is None else scale * value for value, scale in values]

    rows = [[key, *cells(figures)] for key, figures in measured.per_collection.items()]
    return [column, *columns], [*rows, [AVERAGES, *cells(measured)]]
