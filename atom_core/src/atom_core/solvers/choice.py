"""Which solver does the work."""

from __future__ import annotations

from typing import Dict, Optional

from atom_core import native
from atom_core.solvers.base import SolverFactory
from atom_core.solvers.ceres_solver import CeresSolver
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt

CERES, SCIPY = "ceres", "scipy"
SOLVERS: Dict[str, SolverFactory] = {CERES: CeresSolver, SCIPY: LevenbergMarquardt}


def default_solver() -> str:
    """Return ceres where the compiled module is built, else scipy."""
    return CERES if native.available() else SCIPY


def solver_factory(name: Optional[str] = None) -> SolverFactory:
    """Return what makes a solver of the given name, or of the default one."""
    return SOLVERS[name or default_solver()]
