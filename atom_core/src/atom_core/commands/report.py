"""Make report.html and report.pdf from the results of `calibrate`, of `evaluate`, or of both."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.report_files import ReportError, read_given, refuse_reports, write_report
from atom_core.errors import OutputError
from atom_core.io.atomic import prepare_output_folder

EXAMPLE = """
python3 -m atom_core report --calibration results --overwrite
python3 -m atom_core report --calibration results --evaluation evaluation --output report
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    for name, command in (("calibration", "calibrate"), ("evaluation", "evaluate")):
        help_text = f"folder with the results of `{command}`"
        add(parser, name, type=common.named_path, metavar="DIR", help=help_text)
    add(
        parser,
        "changes",
        nargs="+",
        type=common.named_path,
        default=[],
        metavar="FILE",
        help="comparison.json of `evaluate --compare A B`, document of `check --against`",
    )
    add(
        parser,
        "output",
        "-o",
        type=common.named_path,
        metavar="DIR",
        help="folder for the report (default: that of the calibration, or of the evaluation)",
    )
    add(parser, "overwrite", "-ow", action="store_true", help="replace an earlier report")
    common.add_verbose_option(parser)


def run(args: argparse.Namespace) -> int:
    """Write the report; 0."""
    folder: Path = args.output or args.calibration or args.evaluation
    if args.calibration is None and args.evaluation is None:
        raise ReportError("name --calibration DIR, --evaluation DIR, or both")
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: a file is in the way; choose another folder for --output")
    refuse_reports(folder, args.overwrite)
    given = read_given(args.calibration, args.evaluation, changes=args.changes)
    prepare_output_folder(folder, overwrite=True)
    path = write_report(given, folder)
    for remark in given.remarks:
        print(f"warning: {remark}")
    print(f"report: {path}")
    return 0
