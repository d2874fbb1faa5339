#!/usr/bin/env bash
# Which statements the tests execute, of Python and of C++; `make coverage` runs it.
#
# The committed state is cloned into coverage_output/source and built there with gcov's counters, so
# that the build of this checkout stays as it is. pytest and ctest run as in `make test`, programs
# and nodes that they start are counted, too (not those that they kill). Tables are printed and
# stand, line by line, in coverage_output/python and coverage_output/cpp.
#
# Usage: coverage.bash PROCESSES PYTEST... (pytest's command)
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

processes=$1
shift
missing=()
python3 -c 'import pytest_cov' 2>/dev/null || missing+=(python3-pytest-cov)
command -v gcovr >/dev/null || missing+=(gcovr)
if [ "${#missing[@]}" -gt 0 ]; then
  echo "make coverage: needs ${missing[*]}: apt-get install ${missing[*]}" >&2
  exit 2
fi

output=$PWD/coverage_output
source=$output/source
rm -rf "$output"
git clone --quiet --shared . "$source" || exit 1
ln -s "$PWD/.venv" "$source/.venv"
cd "$source" || exit 1
CXXFLAGS="--coverage -O1 -fprofile-update=atomic" LDFLAGS=--coverage \
  make --no-print-directory BUILD_TYPE=None SANITIZED= build >"$output/build.log" 2>&1 &&
  cmake --build build -j "$processes" --target tests >>"$output/build.log" 2>&1 || {
  echo "make coverage: the build failed; see $output/build.log" >&2
  exit 1
}
source ./env.bash

packages=(atom_core/src/atom_core atom_calibration/src/atom_calibration atom_examples/src/atom_examples)
printf '[run]\nparallel = true\nomit = */static/*\n' >.coveragerc
failed=()
# pytest-cov counts in the programs that a test starts by these three, also below ctest.
sources=("${packages[@]/#/$PWD/}")
export COV_CORE_SOURCE COV_CORE_CONFIG=$PWD/.coveragerc COV_CORE_DATAFILE=$PWD/.coverage
COV_CORE_SOURCE=$(IFS=:; echo "${sources[*]}")
nice -n 5 "$@" --cov-config .coveragerc --cov-report= "${sources[@]/#/--cov=}" || failed+=(pytest)
(cd build && env ROS_HOME="$PWD/ros_home" ctest --output-on-failure) || failed+=(ctest)
unset COV_CORE_SOURCE COV_CORE_CONFIG COV_CORE_DATAFILE

python3 -m coverage combine --quiet --append
python3 -m coverage html --quiet --directory "$output/python"
for package in "${packages[@]}"; do
  echo "---- Python: $package"
  python3 -m coverage report --include "$package/*" --skip-covered --sort cover | tee "$output/${package##*/}.txt" | tail -n 40
done
mkdir -p "$output/cpp"
for folder in atom_core/cpp atom_rviz_plugins/src; do
  echo "---- C++: $folder"
  gcovr --root . --filter "$folder/" --html-details "$output/cpp/${folder%%/*}.html" --txt "$output/${folder%%/*}_cpp.txt"
  tail -n 25 "$output/${folder%%/*}_cpp.txt"
done
if [ "${#failed[@]}" -gt 0 ]; then
  echo "make coverage: tests failed, so the figures are too low: ${failed[*]}" >&2
  exit 1
fi
