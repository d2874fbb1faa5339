"""From a rough answer to the solution: intrinsics, boards in wrong minima, bad detections."""
