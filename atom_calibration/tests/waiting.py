"""Waiting in rostests: for a condition, not for seconds."""

import time

import tf2_ros

PATIENCE_S = 60.0  # reached by what is broken only, however busy the machine


def until(condition, what, seconds=PATIENCE_S):
    """Wait for something to become true; return it. What: a text, or what returns one."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {seconds} s: {what() if callable(what) else what}")


def soon(check):
    """Call a check until it passes: what one topic brings may come after what another brings."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            return check()
        except (AssertionError, LookupError, tf2_ros.TransformException):
            if time.monotonic() > end:
                raise
        time.sleep(0.1)
