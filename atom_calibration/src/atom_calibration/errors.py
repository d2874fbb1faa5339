"""Errors of the ROS side; like those of the core, each is one line with its remedy."""

from atom_core.errors import AtomError


class MessageError(AtomError):
    """A message cannot be used: empty, cut off, or in a form that is not known.

    Attributes:
        sensor: whose it is; empty where that is not known.
    """

    def __init__(self, text: str, sensor: str = ""):
        super().__init__(text)
        self.sensor = sensor


class EmptyMessageError(MessageError):
    """A message is sound, and its sensor has measured nothing: nothing is within its reach."""


class BagError(AtomError):
    """A bag cannot be read, or lacks what was asked of it."""


class TransformError(AtomError):
    """A transform is not known: no such frame, nothing connects them, or no tf at that time."""


class CollectionError(AtomError):
    """No collection can be taken, or not as asked."""


class NoDataError(CollectionError):
    """No data are near enough to a time.

    Attributes:
        between: nor are there any that another moment would not have: it lies between the data.
    """

    def __init__(self, text: str, between: bool = False):
        super().__init__(text)
        self.between = between


class ToolError(AtomError):
    """A program that is needed is absent, or fails."""
