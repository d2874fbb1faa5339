"""Reports as files: what they are made from is read from results, and they are written beside."""

from __future__ import annotations

import os
import signal
import sys
import threading
import zlib
from pathlib import Path
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple

from atom_core.commands.provenance import checksum
from atom_core.errors import AtomError, OutputError
from atom_core.io.atomic import write_bytes_atomically
from atom_core.io.dataset_json import read_dataset
from atom_core.io.json_text import load_json
from atom_core.model.dataset import Dataset
from atom_core.report.page.given import Given
from atom_core.report.residual_samples import ResidualSample, from_bytes

HTML_FILE, PDF_FILE = "report.html", "report.pdf"
REPORT_FILES = (HTML_FILE, PDF_FILE)
RESIDUALS_FILE = "residuals.npz"
CALIBRATION_FILE, EVALUATION_FILE = "calibration.json", "evaluation.json"
_DATASET_FILE = "atom_calibration.json"
_KEYS = {  # without these a document is no result
    CALIBRATION_FILE: {
        **dict.fromkeys(("sensors", "edges", "collections", "solver"), dict),
        **dict.fromkeys(("outliers", "rejected_detections", "weak_directions"), list),
        **dict.fromkeys(("status", "message", "dataset"), str),
    },
    EVALUATION_FILE: {"pairs": list, "averages": dict, "train": str, "test": str},
}
_CHANGES_KEYS = {"moved": bool, "sentence": str, "edges": dict}
# What drawing may end with where a result is unlike all that were thought of.
_DRAWING_ERRORS = (
    *(ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, RuntimeError),
    *(TypeError, ValueError, zlib.error),
)


class ReportError(AtomError):
    """A report cannot be made."""


def read_given(
    calibration: Optional[Path],
    evaluation: Optional[Path],
    dataset: Optional[Dataset] = None,
    changes: Sequence[Path] = (),
) -> Given:
    """Return what a report is made from.

    Args:
        calibration: folder of a calibration's results; None: the one of the evaluation's train
            file, where it is there.
        evaluation: folder of an evaluation's results; None: none.
        dataset: the calibrated one, where it is in memory already.
        changes: documents of `evaluate --compare A B` and of `check --against`.

    Raises:
        ReportError: a folder holds no such result, or the evaluation is of another calibration.
    """
    tested = None if evaluation is None else _document(evaluation / EVALUATION_FILE)
    remarks: List[str] = []
    train = None
    if tested is not None and calibration is None:
        train = Path(tested["train"])
        if train.name == _DATASET_FILE and (train.parent / CALIBRATION_FILE).is_file():
            calibration = train.parent
        if calibration is not None and not _is_evaluated(calibration, tested):
            remarks.append(f"{calibration} holds another calibration by now: it is left out")
            calibration = train = None
    elif tested and calibration and not _is_evaluated(calibration, tested):
        raise ReportError(
            f"{evaluation}: it evaluates another calibration than the one in {calibration}, whose "
            f"{_DATASET_FILE} is not the file that was evaluated ({tested['train']}); evaluate it "
            f"again, or leave one of the two out"
        )
    solved = None if calibration is None else _document(calibration / CALIBRATION_FILE)
    if dataset is None:
        path = train if calibration is None else calibration / _DATASET_FILE
        dataset = None if path is None else _dataset(path, remarks)
    residuals: Tuple[ResidualSample, ...] = ()
    if calibration is not None:
        residuals = _residuals(calibration / RESIDUALS_FILE, remarks)
    if dataset is not None:
        remarks += _absent(dataset)
    found = tuple(_checked(path, "evaluate --compare", _CHANGES_KEYS) for path in changes)
    return Given(solved, tested, dataset, residuals, tuple(remarks), found)


def _is_evaluated(calibration: Path, tested: Mapping[str, Any]) -> bool:
    """Tell whether an evaluation is of a calibration; so it is where nobody can know better."""
    path, known = calibration / _DATASET_FILE, tested.get("inputs") or []
    trains = [entry.get("sha256") for entry in known if entry.get("what") == "train"]
    return not trains or not path.is_file() or checksum(path) in trains


def _absent(dataset: Dataset) -> List[str]:
    from atom_core.report.page.data_sections import absent_data

    return absent_data(dataset)


def _document(path: Path) -> Dict[str, Any]:
    what = "calibrate" if path.name == CALIBRATION_FILE else "evaluate"
    return _checked(path, what, _KEYS[path.name])


def _checked(path: Path, what: str, keys: Mapping[str, type]) -> Dict[str, Any]:
    """Read a document that a command has written, and look whether it can be that.

    Raises:
        ReportError: it is absent, or of another kind.
    """
    try:
        document = load_json(path.read_text(encoding="utf-8"))
    except OSError:
        told = f"{path}: there is no such result; name what `{what}` wrote"
        raise ReportError(told) from None
    except ValueError as error:
        raise ReportError(f"{path}: it is no JSON ({error}); run `{what}` again") from None
    for key, kind in keys.items():
        if not isinstance(document, dict) or not isinstance(document.get(key), kind):
            raise ReportError(
                f"{path}: '{key}' is absent or of another kind than `{what}` writes; run it again"
            )
    return document


def _dataset(path: Path, remarks: List[str]) -> Optional[Dataset]:
    """Read the calibrated dataset; a report does without it, and says so."""
    try:
        return read_dataset(path)
    except AtomError as error:
        remarks.append(f"the calibrated dataset cannot be read ({error}): pictures are left out")
        return None


def _residuals(path: Path, remarks: List[str]) -> Tuple[ResidualSample, ...]:
    try:
        return from_bytes(path.read_bytes())
    except (OSError, ValueError) as error:
        remarks.append(f"{path.name} cannot be read ({error}): plots of residuals are left out")
        return ()


def write_report(given: Given, folder: Path) -> Path:
    """Write report.html and report.pdf; return the first.

    Args:
        given: what they are made from.
        folder: it exists; reports in it are replaced.

    Raises:
        ReportError: a library is not installed, or the result is like none that were thought of.
        OutputError: a file cannot be written.
    """
    try:
        from jinja2 import TemplateError

        from atom_core.report.page.html import html
        from atom_core.report.page.make import make_page
        from atom_core.report.page.pdf import pdf
    except ImportError as error:
        raise ReportError(
            f"the report is not made: {error}; install python3-jinja2 and python3-matplotlib"
        ) from None
    try:
        page = make_page(given)
        files = {HTML_FILE: html(page).encode("utf-8", "backslashreplace"), PDF_FILE: pdf(page)}
    except (TemplateError, *_DRAWING_ERRORS) as error:
        raise ReportError(
            f"the report is not made, since drawing it ended with {type(error).__name__}: {error}; "
            f"the results themselves are complete"
        ) from error
    for name, data in files.items():
        write_bytes_atomically(folder / name, data)
    return folder.resolve() / HTML_FILE


def report_beside(
    folder: Path,
    calibration: Optional[Path],
    evaluation: Optional[Path],
    dataset: Optional[Dataset] = None,
) -> None:
    """Write the report of results that stand already, and say where; say why where it fails.

    Args:
        folder: of the results.
        calibration: folder of a calibration, as of `read_given`.
        evaluation: folder of an evaluation, likewise.
        dataset: the calibrated one, likewise.
    """

    def draw() -> None:
        path = write_report(read_given(calibration, evaluation, dataset), folder)
        print(f"\nreport: {path}")

    try:
        _unless_interrupted(draw)
    except (ReportError, OutputError) as error:
        print(f"report: {error}", file=sys.stderr)


def _unless_interrupted(draw: Callable[[], None]) -> None:
    """Draw; a signal ends that at once, also where ROS has taken it for itself.

    Whoever had the signal before gets it then. Only the first one breaks off, and only what is
    drawn: it may come at any moment, also between two lines of this function.
    """
    if threading.current_thread() is not threading.main_thread():
        draw()
        return
    heard: List[int] = []
    drawing = made = False

    def note(number: int, _: object) -> None:
        heard.append(number)
        if drawing and len(heard) == 1:
            raise KeyboardInterrupt

    signals = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in signals}
    try:
        for number in signals:
            signal.signal(number, note)
        try:
            drawing = True
            if not heard:
                draw()
                made = True
        finally:
            drawing = False
    except BaseException:  # before Python 3.12 a RuntimeError, where a class was just made
        drawing = False  # it came before the line above was through
        if not heard:
            raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if heard and not made:
        print("report: interrupted, it is not made; the results are complete", file=sys.stderr)
    if heard:
        os.kill(os.getpid(), heard[0])


def refuse_reports(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds a report already.

    Raises:
        OutputError: naming it and --overwrite.
    """
    there = [name for name in REPORT_FILES if (folder / name).exists()]
    if there and not overwrite:
        raise OutputError(
            f"{folder}: there is a report already ({', '.join(there)}); add --overwrite to replace "
            f"it, or choose another folder with --output"
        )
