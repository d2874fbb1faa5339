#!/usr/bin/env bash
# The C++ parts under GCC's sanitizers; `make test-sanitizers` runs it.
#
# The committed state is cloned into sanitizer_output and built there twice: for addresses and
# undefined behaviour, and for threads. The C++ tests run as they are, and the Python tests that call
# the compiled module with the sanitizer's library loaded before Python. What a sanitizer finds ends
# the program that it was found in, so the test fails.
#
# Usage: sanitizers.bash PROCESSES [address|thread ...]
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

processes=$1
shift
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

# In a folder of its own, so that the build of this checkout stays as it is.
built() { # KIND
  rm -rf "${output:?}/$1" && mkdir -p "$output" && git clone --quiet --shared . "$output/$1" || return
  ln -s "$PWD/.venv" "$output/$1/.venv"
  (
    cd "$output/$1" || exit
    CXXFLAGS="${flags[$1]} -O1 -g -fno-omit-frame-pointer" \
      make --no-print-directory BUILD_TYPE=None configure &&
      cmake --build build -j "$processes" --target _core "${programs[@]}"
  ) >"$output/$1.log" 2>&1
}

for kind in "${kinds[@]}"; do
  if ! built "$kind"; then
    echo "make test-sanitizers: the build failed; see $output/$kind.log" >&2
    exit 1
  fi
  echo "---- $kind: C++"
  for program in "${programs[@]}"; do
    ( # whose environment names the library that was built there
      cd "$output/$kind" && source ./env.bash &&
        LSAN_OPTIONS=suppressions=tests/leaks_of_others.txt:print_suppressions=0 \
          "$(find devel build -name "$program" -type f -executable -print -quit)" --gtest_brief=1
    ) || failed+=("$kind: $program")
  done
  echo "---- $kind: what Python calls"
  (
    cd "$output/$kind" && source ./env.bash &&
      read -ra files <<<"$(tr '\n' ' ' <<<"${calling[$kind]}")" &&
      env "${of_python[$kind]}" OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 \
        FUZZED_LONGEST_S=400 LD_PRELOAD="$(gcc -print-file-name="${libraries[$kind]}"):$(gcc -print-file-name=libstdc++.so)" \
        python3 -m pytest -q -p no:cacheprovider "${files[@]}"
  ) || failed+=("$kind: pytest")
done
if [ "${#failed[@]}" -gt 0 ]; then
  printf -v names '%s, ' "${failed[@]}"
  echo "make test-sanitizers: failed: ${names%, }" >&2
  exit 1
fi
