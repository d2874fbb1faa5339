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
        "`make test-long JOBS=3`",
        "2026-11-28",
        "1022e61",
        "whole, in one piece, on two cores that five other jobs used, too: 1,153 of 1,154 tests "
        "passed, none skipped, in 1 h 57 min (1 h 42 min alone). 200 kills of 200: nothing lost, "
        "nothing half-written, the next start goes on. 480 collections of 480 in 120 plays of a "
        "minute, memory after the first twelve grown by 5 % at most, which is what is allowed (a "
        "run of 26 November: 0.9 %); 500 collections of 500, all whole. All documents typed as a "
        "reader does, in a fresh clone, in a fresh workspace and with a master that was in use; "
        "the own rig from an empty package; the Debian package and the install space alone; 1,500 "
        "damaged files of each kind, 100 command lines of each command, ten minutes of processor "
        "time of fuzzing the compiled module, the report in Chromium at 1280 and 390 px, every "
        "robot from its recording, hard scenes. **Failed**: fuzzing found that a camchain nested "
        "too deeply, in a text that libyaml refuses and ruamel.yaml takes, was a traceback (mended "
        "in ce2ae2c)",
    ),
    Run(
        "`make test-long JOBS=2`, in parts",
        "2026-11-29",
        "1c81b86 to b71f4b0",
        "in two parts, from fresh clones, on a slower machine (2 h 15 min and 1 h 3 min): all of "
        "1,172 tests passed **but the soak, which was ended** after 31 of 120 plays: 124 "
        "collections of 124, memory after the first twelve grown by 1.2 % at most. 200 kills of "
        "200. **Failed in the first part**, mended and passed in the second: fuzzing found that a "
        "dataset without "
        "a version in which `calibration_config.sensors` is a number was a traceback (mended in "
        "c9ded8b); the first guess's markers were published to a topic that its ending node had "
        "just closed, which was a traceback in the log (mended in 8fda5be for all nodes)",
    ),
    Run(
        "`make test-long JOBS=3`, broken off",
        "2026-11-28",
        "04bd345b",
        "**not whole**: ended after 2 h 7 min on a slower machine, 656 of 1,168 tests passed, one "
        "failed. In the soak 252 collections of 252 in 63 plays, memory after the first twelve "
        "grown by 0.3 % at most. **Failed**: a hard scene in which 64 layers labeled a board 11 % "
        "larger that the view cuts, since its narrow end was left out like the post of an easel "
        "(a condition of the day before; mended in 43da5bf3)",
    ),
    Run(
        "`make test-long JOBS=3`, earlier",
        "2026-11-28",
        "d13b9b6",
        "whole: 1,135 of 1,136 passed; on 26 November (a0adf08) 455 of 457. What such runs found "
        "is mended: the migration of a dataset in which a sensor's data are `null` was a traceback "
        "(90b0421), a description whose tags are never closed was read for 20 s (070372d); on "
        "b0e1974 (994 tests) a dataset of which no data file is there was a traceback of `check`, "
        "and so was a list in place of a key of a camchain. One frame of a larger board that the "
        "view cuts has a false label: one cloud does not tell it from wide beams "
        "([labels](labels.md)); a test of its own says so",
    ),
    Run(
        "`.ci/run` (`make test`)",
        "2026-11-29",
        "cd7bfd1",
        "whole, from a fresh clone, with what ccache knew: 8,023 tests of pytest (none skipped, 1 "
        "expected to fail), 27 programs of ctest, 797 tests with Noetic's versions and lint "
        "passed, **20 min 33 s** since set-up (20 min wanted): 41 minutes of processor time on two "
        "slow processors, so that no order of the tests makes it shorter. Machines differ by more "
        "than that: 11 min 33 s on f4c3ead the day before, with 7,981 tests and another long test "
        "beside it; 25 min 52 s on b71f4b0, two hours earlier on the same machine, 3 min 22 s of "
        "them for a build of which ccache knew little",
    ),
    Run(
        "`make test-debian11`",
        "2026-11-29",
        "b71f4b0",
        "whole, from a fresh clone, and all passed, in 26 min in a root that was there, other "
        "programs beside it (with the root, 52 min): built without a change in the sources "
        "(GCC 10.2, Ceres 1.14.0, PCL 1.11.1, RViz 1.14.4, CMake 3.18.4, Python 3.9.2, OpenCV "
        "4.5.1), 7,799 quick tests passed (62 skipped, most since the root has no real data), the "
        "four C++ tests under the address and "
        "undefined sanitizers, `calibrate.test` and the four tests in RViz. Runs before had found "
        "a simulator that could not run with the MuJoCo of Python 3.9 (3.3.7), pictures with their "
        "principal point upside down there, a selection nested 100,000 deep that ended the "
        "process, and a drag of a marker that turned the view (9a66978); all mended",
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
    Run("`docker build`", "", "", "never: no Docker engine at hand"),
    Run(
        "`ctest -j 2` again and again, with eight to 20 processes busy on two processors",
        "2026-11-28",
        "0b6d870",
        "20 times: 13 on 0b6d870, in which all 26 programs passed each time (340 to 424 s), and "
        "before it seven on 2bdd455, with `-j 3`: all passed in six of them. In "
        "one a test of playback looked at a picture before its last point was drawn; it waits for "
        "that now (e7d8dd6). RViz by mouse and keys alone, 22 times more beside RViz's like: in "
        "one, as in one `make test` of the day, a drag began before RViz had drawn the arrow under "
        "the mouse, and turned the view instead, so that all further drags missed; the test looks "
        "anew then (9a66978). On 26 November (4ae05fe) drags of the live cell's board came after a "
        "reset; the test does not depend on that now (9c04768). On 27 November one board in one "
        "of eleven plays of the regression was missed beside six busy processes; mended in "
        "7e950d3, and then every label of twelve such plays, five of them with processes stopped "
        "for seconds, was the same, point by point",
    ),
    Run(
        "`make coverage`",
        "2026-11-25",
        "a7ce020",
        "statements that the tests execute: atom_core 98 % (28,977 of 29,696; 92 % wanted), "
        "atom_calibration 92 % (7,573 of 8,272; 85 % wanted), atom_examples 96 %, the compiled "
        "core 98 % (3,225 of 3,268 lines; 85 % wanted); 5,944 tests passed beside a long "
        "session. **Stopped** after six of the 26 programs of ctest: the rostests run the "
        "nodes, so that atom_calibration's share is higher than that",
    ),
    Run(
        "`make mutants`",
        "2026-11-26",
        "464b373",
        "174 of 200 mutants killed (87 %; 85 % wanted) by the core's quick tests, a draw that "
        "ran whole (`--sample 200 --seed 15`): geometry 41 of 42, problem 53 of 66, solvers 37 "
        "of 42, evaluation 43 of 50. 1,100 tests of laws for modules that only whole runs "
        "tested came before it; without them 94 of the first 121 of seed 14 were killed (78 %, "
        "on 3cab3f8), and 162 of 200 (81 %, on 4f1f938). What survives is equal code "
        "(decorators of subclasses without fields, `reshape` with two negative lengths), limits "
        "met exactly, and tolerances and counts of rounds",
    ),
)
