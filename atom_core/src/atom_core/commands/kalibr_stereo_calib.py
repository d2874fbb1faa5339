"""Put the cameras of a Kalibr camchain into a dataset: intrinsics and where they are."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, write_documents
from atom_core.commands.pair_calibration import refuted
from atom_core.evaluation.baselines.chain import (
    chain_remarks,
    names_of_chain,
    turned_round,
    with_chain,
)
from atom_core.io.dataset_json import document_of, read_dataset
from atom_core.io.kalibr import read_camchain
from atom_core.io.paths import sibling

EXAMPLE = "python3 -m atom_core kalibr_stereo_calib -json dataset.json -k camchain.yaml"
_RESULT = "kalibr_calibration.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    add = common.add_option
    text = "Kalibr's camchain"
    add(parser, "kalibr_file", "-k", required=True, type=Path, metavar="FILE", help=text)
    text = "the dataset's cameras in the order of the chain (default: by their topics)"
    add(parser, "cameras", nargs="+", metavar="NAME", help=text)
    text = f"the new dataset (default: {_RESULT} beside the input)"
    add(parser, "output", "-o", type=Path, metavar="FILE", help=text)
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Apply the chain; the anchored camera, else the first, or one that carries it, stays.

    1: the labels contradict it.
    """
    dataset, chain = read_dataset(args.dataset), read_camchain(args.kalibr_file)
    names = names_of_chain(dataset, chain, args.kalibr_file, list(args.cameras or []))
    by_name = dict(zip(names, chain))
    solved = with_chain(dataset, by_name)
    target = args.output or sibling(args.dataset, _RESULT)
    write_documents(args.dataset, {target: document_of(solved)}, args.overwrite)
    for remark in chain_remarks(dataset, by_name):
        print(remark)
    doubt = refuted(solved, names)
    if not doubt:
        return 0
    hint = "check that chain and dataset are of the same rig, and the order of the cameras"
    if not refuted(with_chain(dataset, turned_round(by_name)), names):
        hint = (
            "with all its poses inverted it fits: T_cn_cnm1 leads from the camera before into this "
            "one; where Kalibr wrote it so, the cameras are named in another order (--cameras)"
        )
    print(
        f"kalibr_stereo_calib: {args.kalibr_file}: the chain is wrong here: {doubt}; {hint}",
        file=sys.stderr,
    )
    return 1
