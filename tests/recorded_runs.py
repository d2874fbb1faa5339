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
        "05ab316",
        "built without a change in the sources (Ceres 1.14.0, PCL 1.11.1, RViz 1.14.4, CMake "
        "3.18.4, Python 3.9.2, OpenCV 4.5.1). Found before, on b9020db: the simulator could not "
        "run with the MuJoCo of Python 3.9 (3.3.7), and its pictures had their principal point "
        "upside down there; mended. Of the 5,641 quick tests one ended its process, and pytest "
        "then waited for ever with "
        "99 % passed: Python 3.9's parser does not come back from a selection nested 100,000 deep; "
        "now refused before, seen there. **Not whole** since: the rest of the quick tests, and the "
        "C++ tests, which catkin 0.8.9 does not link when it configures a second time (mended, not "
        "run). On bfd3a68 the four C++ tests, `calibrate.test` and the three "
        "tests in RViz passed",
    ),
    Run(
        "`pytest -m long atom_core/tests/test_native_fuzzing.py`",
        "2026-11-25",
        "c4c5e2e",
        "ten minutes of processor time: 150,820 inputs without a find, then a cloud whose search "
        "took four minutes (beams a hair apart, all counted); mended, 0.1 s, and that input is in "
        "`make test`. The ten minutes have not been run again",
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
        "2026-11-23",
        "6bf62d4",
        "address and undefined behaviour: found were a shift of a negative number (points more "
        "than 50 km away) and an overflow (width times height of a cloud), both by the fuzzer and "
        "mended; the other 456 Python tests and the 114 C++ tests pass. After the mends the C++ "
        "tests and 1,200 inputs of the fuzzer ran without a find. **Not whole** after them",
    ),
    Run(
        "`tests/sanitizers.bash 1 thread`",
        "2026-11-24",
        "2284356",
        "clean: 114 C++ tests and 215 Python tests",
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
        "2059f98",
        "480 collections saved of 480 in 120 plays of 12 s of data (30 min beside other work). "
        "Memory after the first twelve plays grows by at most 4 % (the labeler of compressed "
        "images, from 210 to 218 MB, ever more slowly; where it goes is not found, decoding and "
        "labeling alone hold theirs); all others by less than 1 %. The two hours of a 60 s "
        "recording have not been run",
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
        "`tests/mutants.py`, its functions by parts",
        "2026-11-25",
        "93f8b6e",
        "**too few**: 230 of 300 mutants killed (77 %; 85 % wanted) by the core's quick tests: "
        "geometry 87 %, problem 79 %, solvers 73 %, evaluation 70 %. Survivors were read in part: "
        "limits whose exact value no test holds, decorators, equal code. Since then the normal "
        "equations, the covariance, scalars beside the poses and points of range sensors are held "
        "against dense algebra (62 tests); what that kills has not been counted",
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
