"""Which baselines `evaluate` puts beside a calibration, and the files that it writes of them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from atom_core.commands import common
from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.chain import KALIBR, chain_baseline
from atom_core.evaluation.baselines.comparison import Measured, RigComparison, compare_rigs
from atom_core.evaluation.baselines.icp import ICP, icp_baselines
from atom_core.evaluation.baselines.icp import METHODS as ICP_METHODS
from atom_core.evaluation.baselines.links import LinkedRig
from atom_core.evaluation.baselines.pairwise import PAIRWISE, pairwise_baseline
from atom_core.evaluation.baselines.stereo import OPENCV, stereo_baseline
from atom_core.evaluation.hand_eye_baselines import METHODS as HAND_EYE_METHODS
from atom_core.evaluation.hand_eye_comparison import HandEyeComparison, compare_hand_eye
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset

HAND_EYE, ALL = "hand_eye", "all"
_NO_CHAIN = "--baseline kalibr: give the camchain that Kalibr wrote as --camchain"
NAMES = (HAND_EYE, OPENCV, ICP, PAIRWISE, KALIBR)
FILES = tuple(
    f"{name}.json"
    for name in (
        *(f"{HAND_EYE}_{method}" for method in HAND_EYE_METHODS),
        *(OPENCV, *ICP_METHODS, PAIRWISE, KALIBR),
    )
)


class Baselines(NamedTuple):
    """What was put beside a calibration.

    Attributes:
        hand_eye: OpenCV's methods for cameras on an arm; None where they were not asked for.
        rigs: methods that take two sensors at a time.
        remarks: why some of all cannot be had.
        missed: why methods that were named cannot be had.
    """

    hand_eye: Optional[HandEyeComparison] = None
    rigs: Tuple[RigComparison, ...] = ()
    remarks: Tuple[str, ...] = ()
    missed: Tuple[str, ...] = ()

    @property
    def datasets(self) -> Dict[str, Dataset]:
        """The results as datasets, by the names of their files."""
        found = {}
        for baseline in self.hand_eye.baselines if self.hand_eye else ():
            if baseline.dataset is not None:
                found[f"{HAND_EYE}_{baseline.method}.json"] = baseline.dataset
        for comparison in self.rigs:
            if comparison.rig.dataset is not None:
                found[f"{comparison.rig.method}.json"] = comparison.rig.dataset
        return found


def add_baseline_options(parser: argparse.ArgumentParser) -> None:
    """Add the choice of baselines, and the files that they need."""
    add = common.add_option
    text = (
        "put other methods beside it, on the labels of the train file; each result is written as a "
        "dataset: OpenCV's hand-eye methods, OpenCV's stereo, ICP of whole clouds, every pair by "
        "itself, Kalibr's camchain, or all that can be had"
    )
    add(parser, "baseline", nargs="+", choices=[*NAMES, ALL], default=[], help=text)
    text = "icp: the dataset before it was calibrated, from whose transforms ICP starts, too"
    add(parser, "initial", type=Path, metavar="FILE", help=text)
    text = "kalibr: the camchain that Kalibr wrote"
    add(parser, "camchain", type=Path, metavar="FILE", help=text)
    text = "kalibr: the dataset's cameras in the order of the chain (default: by their topics)"
    add(parser, "cameras", nargs="+", metavar="NAME", help=text)


def chosen_baselines(
    args: argparse.Namespace, measured: Measured, sensors: Optional[Sequence[str]]
) -> Baselines:
    """Solve by the methods that were asked for, and evaluate each like the calibration.

    Args:
        args: of `add_baseline_options`.
        measured: the calibration, and what it is measured on.
        sensors: only these; None: all.

    A method that has nothing to solve is left out with a remark, and the others go on.

    Raises:
        DatasetError: a file that was named for a method cannot be used, or is missing.
    """
    if not args.baseline:
        return Baselines()
    wanted = NAMES if ALL in args.baseline else tuple(args.baseline)
    train = measured.train.selected(sensors, None, list(measured.test.patterns))
    files = _named_files(args, train, wanted)
    hand_eye: Optional[HandEyeComparison] = None
    rigs: List[LinkedRig] = []
    left_out: Dict[str, str] = {}
    for name in (name for name in NAMES if name in wanted):
        try:
            if name == HAND_EYE:
                hand_eye = _hand_eye(measured, sensors)
            else:
                rigs += _checked(name, _SOLVED[name](files, train))
        except DatasetError as error:
            left_out[name] = str(error)
    remarks = tuple(why for name, why in left_out.items() if name not in args.baseline)
    missed = tuple(why for name, why in left_out.items() if name in args.baseline)
    return Baselines(hand_eye, tuple(compare_rigs(rigs, measured, sensors)), remarks, missed)


class _Files(NamedTuple):
    """What was read of the files that were named for methods."""

    initial: Optional[Dataset]
    chain: Optional[LinkedRig]


def _named_files(args: argparse.Namespace, train: Dataset, wanted: Sequence[str]) -> _Files:
    """Read the files that were named for methods.

    Raises:
        DatasetError: one cannot be used, or Kalibr was named without its camchain.
    """
    if KALIBR in args.baseline and not args.camchain:
        raise DatasetError(_NO_CHAIN)
    initial = read_dataset(args.initial) if args.initial and ICP in wanted else None
    chain = None
    if args.camchain and KALIBR in wanted:
        chain = chain_baseline(train, args.camchain, common.strings(args.cameras))
    return _Files(initial, chain)


def _hand_eye(measured: Measured, sensors: Optional[Sequence[str]]) -> HandEyeComparison:
    return compare_hand_eye(
        measured.train,
        measured.test,
        measured.evaluation,
        truth=measured.truth,
        sensors=sensors,
    )


def _checked(name: str, rigs: List[LinkedRig]) -> List[LinkedRig]:
    """Return the answers, if there is any.

    Raises:
        DatasetError: no pair could be solved; the message says why.
    """
    if any(rig.links for rig in rigs):
        return rigs
    reasons = dict.fromkeys(why for rig in rigs for why in rig.unsolved.values())
    why = "; ".join(reasons) or "there are no two sensors of its kinds"
    raise DatasetError(f"--baseline {name}: no pair could be solved: {why}")


def _kalibr(files: _Files, train: Dataset) -> List[LinkedRig]:
    if files.chain is None:
        raise DatasetError(_NO_CHAIN)
    return [files.chain]


_SOLVED: Dict[str, Callable[[_Files, Dataset], List[LinkedRig]]] = {
    OPENCV: lambda files, train: [stereo_baseline(train)],
    ICP: lambda files, train: icp_baselines(train, files.initial),
    PAIRWISE: lambda files, train: [pairwise_baseline(train)],
    KALIBR: _kalibr,
}
