"""Scans of 2D LiDARs."""

from __future__ import annotations

from typing import Any

from sensor_msgs.msg import LaserScan as ScanMessage

from atom_calibration.errors import EmptyMessageError, MessageError
from atom_core.errors import DatasetError, NothingMeasuredError
from atom_core.model.laser_scan import LaserScan, fields_of, scan_from_fields

_FIELDS = tuple(name for name in ScanMessage.__slots__ if name != "header")


def laser_scan(message: Any) -> LaserScan:
    """Return the scan of a LaserScan message.

    Raises:
        MessageError: counts and angles do not fit together; `EmptyMessageError`: no range is
            valid.
    """
    try:
        return scan_from_fields({name: getattr(message, name) for name in _FIELDS})
    except NothingMeasuredError as error:
        raise EmptyMessageError(str(error)) from None
    except DatasetError as error:
        raise MessageError(str(error)) from None


def scan_message(scan: LaserScan) -> ScanMessage:
    """Return the LaserScan message of a scan; the header is left to the caller."""
    fields = fields_of(scan)
    return ScanMessage(**{name: fields[name] for name in _FIELDS})
