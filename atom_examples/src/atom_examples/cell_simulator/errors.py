"""What can go wrong in the simulator and be mended by its user."""

from atom_core.errors import AtomError


class SimulatorError(AtomError):
    """The world cannot be built or drawn, or the bag cannot be written; one line with a remedy."""
