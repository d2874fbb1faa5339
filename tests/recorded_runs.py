"""What does not run every day: when it last did, at which commit, and what it said.

`docs/make_reliability.py` writes them into docs/reliability.md. Who runs one of them writes here
what it printed.
"""

from __future__ import annotations

from typing import NamedTuple


class Run(NamedTuple):
    """One run.

    Attributes:
        command: what was run.
        date: day of the run, "" if it never was.
        commit: what was checked out.
        said: its outcome.
    """

    command: str
    date: str
    commit: str
    said: str


RUNS = (
    Run(
        "`make test-debian11`",
        "2026-11-25",
        "7bb6257",
        "whole: built without a change in the sources (Ceres 1.14.0, PCL 1.11.1, RViz 1.14.4, "
        "CMake 3.18.4, Python 3.9.2, OpenCV 4.5.1), 5,642 quick tests passed (67 skipped), the "
        "four C++ tests, `calibrate.test` and the three tests in RViz. Runs before had found a "
        "simulator that could not run with the MuJoCo of Python 3.9 (3.3.7), pictures with their "
        "principal point upside down there, and a selection nested 100,000 deep that ended the "
        "process; all mended",
    ),
    Run(
        "`pytest -m long atom_core/tests/test_native_fuzzing.py`",
        "2026-11-25",
        "ab73aa5",
        "clean: ten minutes of processor time. The run before, on c4c5e2e, had found a cloud whose "
        "search took four minutes (beams a hair apart, all counted); mended, and that input is in "
        "`make test`",
    ),
    Run(
        "`make test-opencv-versions`",
        "2026-11-25",
        "25684d1",
        "whole for the first time: 4.2.0 (Python 3.8, numpy 1.17.4) 1,451 passed, 4.6.0 and 4.10.0 "
        "964 each. Found: with 4.5.5 the depth labeler ended the process (a fault of OpenCV's own, "
        "its connected components), with 5.0.0 there is no `calibrateHandEye`, which was a "
        "traceback. Both mended; then, on 2f430d0, 4.5.5 972 passed (1 skipped), 5.0.0 938 (15 "
        "skipped)",
    ),
    Run(
        "`make test-sanitizers`",
        "2026-11-26",
        "f850b24",
        "whole and clean, half an hour beside RViz: 114 C++ tests under each of address with "
        "undefined behaviour, and threads; 472 Python tests that call the compiled module under "
        "the first, 217 under the second. Runs before had found a shift of a negative number "
        "(points more than 50 km away) and an overflow (width times height of a cloud); mended",
    ),
    Run(
        "`atom_calibration/tests` with `MALLOC_CHECK_=3` (libc_malloc_debug)",
        "2026-11-24",
        "b496b5f",
        "clean: 592 tests; before, the process was aborted at its end: a yuv422 image of an odd "
        "width made OpenCV write beyond its memory. `valgrind` on 400 damaged clouds, images, "
        "compressed images and camera_infos each, and on 60 damaged bags, finds nothing more",
    ),
    Run(
        "`python3 tests/benchmarks/rviz_clicks.py --clicks 1000 --busy 2`",
        "2026-11-25",
        "b9be7db",
        "1,000 clicks into a picture of 1,000 arrived, once and where they were, on two processors "
        "that had four more processes to run; 0.17 s from the mouse to the message in the median, "
        "0.35 s at most in 99 of 100",
    ),
    Run(
        "`python3 tests/benchmarks/rviz_starts.py --starts 300 --parallel 6`",
        "2026-11-25",
        "643c2b7",
        "300 starts of 300 came up and ended well, six at a time on two processors",
    ),
    Run(
        "`python3 tests/benchmarks/rviz_at_random.py --minutes 60 --seed 11`",
        "2026-11-26",
        "1041fec",
        "an hour, 3,640 things done at random with RViz and playback, beside other work: nothing "
        "died, both ended well, and what was saved was whole. RViz's memory did not grow; that of "
        "playback grew from 250 to 400 MB: **not explained whole** (131 MB were free memory in the "
        "C library's heaps, of which each thread has one; it is not the steps to undo, and 1,500 "
        "turns, undos and saves by themselves hold it at 280 to 310 MB). Earlier runs had found "
        "that quitting playback looked like the death of a process; mended",
    ),
    Run(
        "`make deb`",
        "2026-11-25",
        "397920b",
        "a package of 4 MB that names no folder of its build; installed on Debian 12 by apt, "
        "`calibrate` run by a user without rights, removed: nothing is left below /opt/atom. (A "
        "first package, never committed, lacked all Python: only installing it showed that.) From "
        "an install space alone the demo and RViz run (a test of `make test-long`)",
    ),
    Run(
        "`pytest -m long atom_calibration/tests/test_long_session.py -k 120`",
        "2026-11-25",
        "a7ce020",
        "(with the test of 5a2df95) 480 collections saved of 480 in 120 plays of a minute (two "
        "hours of data in 2 h 34 min, beside everything else that ran that day). Memory after the "
        "first twelve plays grows by 3.2 % at most (the labeler of compressed images, from 212 to "
        "219 MB, all of it before the "
        "fortieth play: the heap of the C library, in which what is in use stays at 28 MB); all "
        "others by less than 1 %",
    ),
    Run(
        "`pytest -m long atom_calibration/tests/test_long_session.py -k 500`",
        "2026-11-26",
        "ca62c8d",
        "500 collections saved of 500, all whole, with the data of every sensor; 12 min, beside a "
        "whole run of pytest and RViz",
    ),
    Run(
        "`pytest -m long tests/test_killed_programs.py`",
        "2026-11-25",
        "6dba039",
        "200 kills of 200: nothing lost, nothing half-written, the next start goes on",
    ),
    Run(
        "`pytest -m long tests/test_documents.py tests/test_own_rig.py`",
        "2026-11-25",
        "6a6b7b8",
        "with a master that was in use and in a fresh workspace: passed (17 min); in a fresh clone "
        "last on 0223fb0; the own rig from an empty package on e0d26c5",
    ),
    Run(
        "`pytest -m long tests/test_report_in_browser.py`",
        "2026-11-25",
        "6dba039",
        "passed in Chromium at 1280 and 390 px",
    ),
    Run("`docker build`", "", "", "never: no Docker engine at hand"),
    Run(
        "`make coverage`",
        "2026-11-25",
        "a7ce020",
        "statements that the tests execute: atom_core 98 % (28,977 of 29,696; 92 % wanted), "
        "atom_calibration 92 % (7,573 of 8,272; 85 % wanted), atom_examples 96 %, the compiled "
        "core 98 % (3,225 of 3,268 lines; 85 % wanted); 5,944 tests passed beside the long "
        "session above. **Stopped** after six of the 26 programs of ctest: the rostests run the "
        "nodes, so that atom_calibration's share is higher than that",
    ),
    Run(
        "`make mutants`",
        "2026-11-25",
        "feb8726",
        "118 of 138 mutants killed (85.5 %; 85 % wanted) by the core's quick tests: geometry 31 of "
        "32, problem 30 of 36, solvers 27 of 31, evaluation 30 of 39; a draw of 200 in random "
        "order (`--sample 200 --seed 11`), **stopped** after 138 for time. Before, on 77623f4, 300 "
        "of another draw ran whole: 240 killed (80 %), and 5 that the tool did not count, as their "
        "module could not be imported. Those survivors were read: tests were added for what no "
        "test held (limits, scatter and trifles of drift, usual errors, pairs, covariances), and "
        "mutants of constants and decorators now run the tests of the lines that use them, not "
        "those that happen to import them first. What survives now: numbers of iterations and "
        "tolerances, equal code, and conditions of baselines",
    ),
    Run(
        "`pytest -m long atom_core/tests/commands/test_odd_command_lines.py "
        "atom_calibration/tests/test_odd_options.py`",
        "2026-11-25",
        "d8bed9c",
        "100 command lines for each of 49 commands and 9 programs that read bags: found were names "
        "with a slash and none (tracebacks), a share of 10^308 %, and `--hold 1e9`, which took all "
        "memory; all mended, the commands that were found run again",
    ),
    Run(
        "`pytest -m long atom_core/tests/io/test_damaged_files.py`",
        "2026-11-25",
        "feb8726",
        "1,500 draws of datasets (read, solved, migrated) without a find, after up to 6,000 had "
        "found seven faults; the other files had 200 and some 6,000 draws",
    ),
    Run(
        "`make test-long` but kills, documents, own rig and browser (rows above), and the fuzzer",
        "2026-11-25",
        "93f8b6e",
        "345 passed, 5 failed (70 min). Mended since: a chessboard that a detector sees beside its "
        "place, boards right before a wall with 64 layers, and a sound recording with 2D scanners "
        "that was called wrong (Ceres stopped too early), and the Debian package, which "
        "named the folder of its build. **Open**: one frame of a cut, other board before 64 "
        "layers has a false label, which is known",
    ),
)
