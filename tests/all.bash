#!/usr/bin/env bash
# Lint, the build and every test, so that no processor is idle while there is work; `make test`
# runs it.
#
# Lint and the tests with Noetic's versions need no build; lint takes what the others leave over.
# Rostests wait for much of their time, so pytest runs beside them, and yields to them (nice): they
# play data by the clock. What plays a whole recording (label "real_time") comes last, one after the
# other, and then pytest takes no more than what is left over, too. What runs beside pytest writes to
# build/test_logs; it is printed when it has ended.
#
# Usage: all.bash PROCESSES PYTEST... (pytest's command)
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

processes=$1
shift
logs=$PWD/build/test_logs
rm -rf build/test_results "$logs"
mkdir -p "$logs"
failed=()
declare -A started=()

# Each of them is a group of processes of its own, so that Ctrl-C here ends all of them.
beside() { # NAME COMMAND...: start a command
  set -m
  "${@:2}" >"$logs/$1.log" 2>&1 </dev/null &
  set +m
  started[$1]=$!
}

ended() { # NAME: wait for it, print what it said, remember whether it failed
  wait "${started[$1]}" || failed+=("$1")
  unset "started[$1]"
  echo "---- $1"
  cat "$logs/$1.log"
}

stop_all() {
  local process
  for process in "${started[@]}"; do kill -TERM -- "-$process" 2>/dev/null; done
}
trap stop_all EXIT
trap 'exit 130' INT TERM

rostests() {
  local status=0
  run_ctest -j "$processes" --label-exclude real_time || status=1
  renice -n 19 -g "${started[pytest]}" >/dev/null 2>&1 # unless it has ended
  echo "---- ctest, in real time"
  run_ctest --label-regex real_time || status=1
  return $status
}

# One thread of linear algebra in each process, as for pytest (Makefile).
run_ctest() {
  (cd build && env ROS_HOME="$PWD/ros_home" OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
    ctest --output-on-failure "$@")
}

beside lint nice -n 19 make --no-print-directory lint-only
# One variant of nearly each test: whether these versions have what we call; laws are tested below.
beside "Noetic's versions" nice -n 5 env ATOM_TEST_VARIANTS=1 bash tests/noetic_versions.bash
if ! make --no-print-directory build; then
  echo "make test: the build failed; no test was run" >&2
  exit 1
fi
source ./env.bash
flock CMakeLists.txt cmake --build build -j "$processes" --target tests || failed+=("tests' build")
built_s=$SECONDS
set -m # pytest, whose words are to be seen as they come, is a group of its own, too
nice -n 5 "$@" </dev/null &
set +m
started[pytest]=$!
beside ctest rostests
wait "${started[pytest]}" || failed+=(pytest)
unset "started[pytest]"
ended ctest
ended lint
ended "Noetic's versions"
python3 tests/failed_cases.py build/test_results
echo "make test: $((SECONDS / 60)) min $((SECONDS % 60)) s since set-up, $built_s s of them for the build"
if [ "${#failed[@]}" -gt 0 ]; then
  printf -v names '%s, ' "${failed[@]}"
  echo "make test: failed: ${names%, }" >&2
  exit 1
fi
