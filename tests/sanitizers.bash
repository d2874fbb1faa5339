#!/usr/bin/env bash
# The C++ parts under GCC's sanitizers; `make test-sanitizers` runs it.
#
# They are built anew in sanitizer_output, for addresses and undefined behaviour, and for threads.
# The C++ tests run as they are, and the Python tests that call the compiled module with the
# sanitizer's library loaded before Python. What a sanitizer finds ends the program that it was
# found in, so the test fails. --cpp_only: the C++ tests alone.
#
# Usage: sanitizers.bash PROCESSES [--cpp_only] [address|thread ...]
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

processes=$1
shift
with_python=yes
if [ "${1:-}" = --cpp_only ]; then
  with_python=
  shift
fi
kinds=("$@")
[ "${#kinds[@]}" -gt 0 ] || kinds=(address thread)
output=$PWD/sanitizer_output
tests=atom_core/tests
programs=(atom_core_test_board_segmentation atom_core_test_planar_compression atom_core_test_urdf
  atom_rviz_plugins_test_logic)
declare -A flags=(
  [address]="-fsanitize=address,undefined -fno-sanitize-recover=undefined"
  [thread]="-fsanitize=thread"
)
declare -A libraries=([address]=libasan.so [thread]=libtsan.so)
# Python and its libraries keep what they allocate until they end: leaks are told of C++ alone.
declare -A of_python=(
  [address]="ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1"
  [thread]="TSAN_OPTIONS=halt_on_error=1"
)
declare -A calling=(
  [address]="$tests/test_native.py $tests/test_native_fuzzing.py $tests/solvers/test_ceres_solver.py
    $tests/labeling/test_lidar3d.py $tests/labeling/test_cloud_boards.py $tests/io/test_pcd.py
    $tests/io/test_urdf.py"
  [thread]="$tests/test_native.py $tests/solvers/test_ceres_solver.py"
)
failed=()

# In folders of its own, so that the build of this checkout stays as it is.
built() { # KIND
  local targets=("${programs[@]}") folder=$output/$1
  [ -z "$with_python" ] || targets+=(_core)
  rm -rf "${folder:?}"
  mkdir -p "$folder"
  env -u CMAKE_PREFIX_PATH -u ROS_PACKAGE_PATH -u PYTHONPATH CXXFLAGS="${flags[$1]} -O1 -g1 -fno-omit-frame-pointer" \
    cmake -S . -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_PREFIX_PATH= \
    -DPYTHON_EXECUTABLE="$PWD/.venv/bin/python3" -DCATKIN_ENABLE_TESTING=ON \
    -DCATKIN_DEVEL_PREFIX="$folder/devel" >"$output/$1.log" 2>&1 &&
    cmake --build "$folder/build" -j "$processes" --target "${targets[@]}" >>"$output/$1.log" 2>&1
}

for kind in "${kinds[@]}"; do
  if ! built "$kind"; then
    echo "sanitizers: the build failed; see $output/$kind.log" >&2
    exit 1
  fi
  # shellcheck disable=SC1091
  source "$output/$kind/devel/setup.bash"
  echo "---- $kind: C++"
  for program in "${programs[@]}"; do
    LSAN_OPTIONS=print_suppressions=0 \
      "$(find "$output/$kind" -name "$program" -type f -executable -print -quit)" --gtest_brief=1 ||
      failed+=("$kind: $program")
  done
  [ -n "$with_python" ] || continue
  echo "---- $kind: what Python calls"
  read -ra files <<<"$(tr '\n' ' ' <<<"${calling[$kind]}")"
  env "${of_python[$kind]}" OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 \
    FUZZED_LONGEST_S=400 LD_PRELOAD="$(gcc -print-file-name="${libraries[$kind]}"):$(gcc -print-file-name=libstdc++.so)" \
    python3 -m pytest -q -p no:cacheprovider "${files[@]}" || failed+=("$kind: pytest")
done
if [ "${#failed[@]}" -gt 0 ]; then
  printf -v names '%s, ' "${failed[@]}"
  echo "sanitizers: failed: ${names%, }" >&2
  exit 1
fi
