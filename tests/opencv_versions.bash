#!/usr/bin/env bash
# Runs the tests of the labelers, and of what else calls OpenCV in the core, with several versions
# of OpenCV (requirements/opencv.txt, in .opencv) and prints a table. 4.2 has the Python and numpy
# of Noetic (tests/noetic_versions.bash), the others this machine's. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

core=atom_core/tests
tested=("$core"/labeling "$core"/geometry "$core"/synthetic/test_board_image.py "$core"/io/test_images.py
  "$core"/editing/test_guess_fit.py "$core"/evaluation/test_hand_eye.py "$core"/evaluation/test_baselines.py)
logs=$PWD/build/opencv_versions
mkdir -p "$logs" .opencv
mapfile -t versions < <(sed 's/#.*//' requirements/opencv.txt | xargs -n 1)
rows=("OpenCV|Python|numpy|passed|failed|skipped|seconds")
failed=()

# The wheel alone: numpy stays the one that the compiled module and scipy are made for.
fetch() { # VERSION
  [ ! -d ".opencv/$1" ] || return 0
  rm -rf .opencv/unfinished
  python3 -m pip install --quiet --disable-pip-version-check --no-deps --only-binary :all: \
    --target .opencv/unfinished "opencv-contrib-python-headless==$1"
  mv .opencv/unfinished ".opencv/$1"
}

count() { # WORD FILE: the number before it in pytest's last line
  tail -n 1 "$2" | grep -oE "[0-9]+ $1" | cut -d ' ' -f 1 || echo 0
}

row() { # VERSIONS LOG SECONDS
  rows+=("$1|$(count passed "$2")|$(count failed "$2")|$(count skipped "$2")|$3")
}

ask='import sys, cv2, numpy; print(cv2.__version__, sys.version.split()[0], numpy.__version__, sep="|")'

run() { # VERSION PYTEST_ARGUMENTS...
  local version=$1 log=$logs/$1.log begun=$SECONDS found
  fetch "$version"
  found=$(PYTHONPATH=$PWD/.opencv/$version:$PYTHONPATH python3 -c "$ask")
  [[ $version == "${found%%|*}".* ]] || { # 4.10.0.84 calls itself 4.10.0
    echo "test-opencv-versions: OpenCV $version was asked for, ${found%%|*} answers" >&2
    exit 2
  }
  echo "OpenCV $version: $log"
  PYTHONPATH=$PWD/.opencv/$version:$PYTHONPATH python3 -m pytest -n "$(nproc)" --dist loadfile \
    -p no:cacheprovider -q "${@:2}" "${tested[@]}" >"$log" 2>&1 || failed+=("$version")
  row "$found" "$log" $((SECONDS - begun))
}

run_noetic() { # PYTEST_ARGUMENTS...
  local log=$logs/noetic.log begun=$SECONDS
  echo "OpenCV of Noetic: $log"
  bash tests/noetic_versions.bash "$@" >"$log" 2>&1 || failed+=("Noetic's")
  if grep -q "^test-noetic-versions: SKIPPED" "$log"; then
    rows+=("4.2.0|none|||||")
    cat "$log"
  else
    row "$(.venv-noetic/bin/python -c "$ask")" "$log" $((SECONDS - begun))
  fi
}

export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
run_noetic "$@"
for version in "${versions[@]}"; do
  run "$version" "$@"
done
printf '%s\n' "${rows[@]}" | column -t -s '|'
if [ "${#failed[@]}" -gt 0 ]; then
  for version in "${failed[@]}"; do grep -h -E '^(FAILED|ERROR) ' "$logs/${version/Noetic\'s/noetic}.log" || true; done
  printf -v names '%s, ' "${failed[@]}"
  echo "test-opencv-versions: failed: ${names%, }" >&2
  exit 1
fi
