"""Speed of the LiDAR labeler: clouds of 16 x 1800 beams in a room, with people beside the board.

Prints one table: rates by the wall clock, which depends on what else runs, and per second of
processor time of one core.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Callable, List, Tuple

import numpy as np

from atom_core.labeling.lidar3d import Cloud, board_at, find_boards
from atom_core.report.tables import text_table

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "atom_core" / "tests" / "labeling"))
from lidar_scenes import BORDER, Cylinder, many_scenes, scan  # noqa: E402

LEAST_PER_S = 60.0
Item = Tuple[Cloud, np.ndarray]


def clouds(count: int = 60) -> List[Item]:
    """Return clouds with rings as a message has them, and a seed for each, 0.2 m off."""
    items, rng = [], np.random.default_rng(0)
    for k, scene in enumerate(many_scenes(count, 7)):
        x, y = rng.uniform(-3.0, 3.0, 2)
        people = [Cylinder(x, y, 0.2, 0.0, 1.8), Cylinder(-y, x, 0.2, 0.0, 1.7)]
        cloud = scan(scene._replace(things=people), k)
        if np.sum(cloud.on_board) > 50:
            seed = cloud.seed + 0.2 * rng.standard_normal(3) / np.sqrt(3.0)
            items.append((Cloud(cloud.points.astype(np.float32), cloud.ring), seed))
    return items


def rate(job: Callable[[Item], Any], items: List[Item], threads: int) -> float:
    """Return how many items a second are done, the best of three rounds."""
    best = np.inf
    for _ in range(3):
        start = time.perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(job, items))
        best = min(best, time.perf_counter() - start)
    return len(items) / best


def core_rate(job: Callable[[Item], Any], items: List[Item]) -> float:
    """Return how many items are done in a second of processor time, the best of three rounds."""
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        for item in items:
            job(item)
        best = min(best, time.process_time() - start)
    return len(items) / best


def main() -> None:
    """Measure with a seed, without the ring field, and without a seed; on one thread and two."""
    items = clouds()
    jobs = {
        "with a seed": lambda item: board_at(item[0], BORDER, item[1]),
        "with a seed, no ring field": lambda item: board_at(Cloud(item[0].points), BORDER, item[1]),
        "search": lambda item: find_boards(item[0], BORDER),
    }
    rows = [
        [name, *(rate(job, items, threads) for threads in (1, 2)), core_rate(job, items)]
        for name, job in jobs.items()
    ]
    found = sum(board_at(cloud, BORDER, seed).labeled.detected for cloud, seed in items)
    points = int(np.mean([len(cloud.points) for cloud, _ in items]))
    title = f"LiDAR labeler: {len(items)} clouds of {points} points, {found} boards found"
    print(text_table(["", "1 thread [1/s]", "2 threads [1/s]", "[1 / core s]"], rows, title, 1))
    print(f"required with a seed, two threads: {LEAST_PER_S:.0f} /s")


if __name__ == "__main__":
    main()
