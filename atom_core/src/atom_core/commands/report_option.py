"""The option that leaves the report out."""

from __future__ import annotations

import argparse

from atom_core.commands import common

LEFT_OUT = False  # without the option; tests that do not look at reports set it


def add_report_option(parser: argparse.ArgumentParser) -> None:
    """Add --no_report."""
    common.add_option(
        parser,
        "no_report",
        action="store_true",
        default=LEFT_OUT,
        help="write the results without report.html and report.pdf (`report` makes them later)",
    )
