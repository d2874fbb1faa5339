"""Waiting in rostests: for a condition, not for seconds."""

import time

PATIENCE_S = 15.0


def until(condition, what, seconds=PATIENCE_S):
    """Wait for something to become true; return it."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {seconds} s: {what}")
