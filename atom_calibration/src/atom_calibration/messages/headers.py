"""Headers of messages: stamps, names of frames."""

from __future__ import annotations

from typing import Any, Dict


def stamp_s(message: Any) -> float:
    """Return the time of a message's data [s]."""
    return float(message.header.stamp.to_sec())


def frame_name(name: str) -> str:
    """Return a frame's name as tf2 has it, without the slash of old drivers."""
    return name.lstrip("/")


def header_document(message: Any) -> Dict[str, Any]:
    """Return a header as plain values, as ATOM's datasets have it."""
    stamp = message.header.stamp
    return {
        "seq": int(message.header.seq),
        "stamp": {"secs": int(stamp.secs), "nsecs": int(stamp.nsecs)},
        "frame_id": frame_name(message.header.frame_id),
    }
