#!/usr/bin/env bash
# Runs the tests of the Python core with the versions of Python and its libraries that ROS Noetic
# has (requirements/noetic.txt), in .venv-noetic. The compiled module belongs to the system's own
# Python: what needs it skips itself, or is named below. Arguments go to pytest; --prepare alone makes
# .venv-noetic and runs nothing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV PYENV_VERSION

venv=.venv-noetic
core=atom_core/tests
tested=("$core"/{geometry,model,problem,labeling,io} "$core"/report/test_page.py)
# What takes long and depends on no version of anything.
left_out=(--deselect "$core/io/test_dataset_structure.py::test_any_value_anywhere_is_read_or_refused_in_one_line"
  --deselect "$core/io/test_dataset_writer.py::test_the_paper_cell_goes_to_disk_and_back"
  --ignore "$core/io/test_damaged_files.py"
  --deselect "$core/io/test_collections.py::test_a_kill_amid_the_setting_aside_is_undone"
  --deselect "$core/io/test_collections.py::test_a_kill_amid_the_removing_leaves_no_collection_without_its_data"
  --deselect "$core/geometry/test_rectangle.py::test_distance_is_that_to_the_nearest_border_sample"
  --deselect "$core/geometry/test_polyline.py::test_distance_agrees_with_dense_sampling"
  --deselect "$core/labeling/test_chessboard.py::test_noise_alone_is_no_board")
# Where one variant of each test is enough, these are left to `make test-noetic-versions`.
if [ -n "${ATOM_TEST_VARIANTS:-}" ]; then
  slow=$core/labeling/test_chessboard.py
  left_out+=(--deselect "$slow::test_a_grid_that_a_detector_puts_beside_the_board_is_put_right"
    --deselect "$slow::test_of_two_boards_none_is_taken"
    --deselect "$slow::test_half_a_second_board_does_no_harm"
    --deselect "$slow::test_any_board_is_found_in_its_order_and_without_bias"
    --deselect "$core/labeling/test_rgb.py::test_corners_are_exact_and_without_bias"
    --deselect "$core/labeling/test_rgb.py::test_charuco_real"
    --deselect "$core/report/test_page.py::test_the_paper_has_a_cover_and_its_pages_are_filled")
fi
needs_compiled=("$core"/io/test_urdf{,_writing}.py)

find_python() {
  local candidate
  for candidate in python3.8 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.8*/bin/python3.8; do
    # pyenv's stand-in on the PATH may be there without a Python behind it
    if "$candidate" -c 'import sys, venv; sys.exit(sys.version_info[:2] != (3, 8))' 2>/dev/null; then
      echo "$candidate"
      return
    fi
  done
}

checksum=$(sha256sum <requirements/noetic.txt)
if [ "$(cat "$venv/requirements.sha256" 2>/dev/null)" != "$checksum" ] || ! "$venv/bin/python" -c ''; then
  python=$(find_python)
  if [ -z "$python" ]; then
    echo "test-noetic-versions: SKIPPED: no Python 3.8 on the PATH or in pyenv; \`pyenv install 3.8\` brings it" >&2
    exit 0
  fi
  "$python" -m venv --clear "$venv"
  # -O0: what has no wheel is compiled here, to be imported only
  CFLAGS=-O0 "$venv/bin/pip" install --quiet --quiet --disable-pip-version-check \
    --only-binary numpy,scipy,opencv-contrib-python-headless -r requirements/noetic.txt || {
    echo "test-noetic-versions: $venv cannot be filled; see requirements/noetic.txt and the message above" >&2
    exit 2
  }
  printf '%s' "$checksum" >"$venv/requirements.sha256"
fi
[ "${1:-}" != --prepare ] || exit 0

# One thread of linear algebra in each process, as for the other tests (Makefile). One process: each
# would read and rewrite all tests anew, and `make test` has other work for the second processor.
env PYTHONPATH=atom_core/src PYTHONDONTWRITEBYTECODE=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
  "$venv/bin/python" -m pytest -p no:cacheprovider --assert=plain -q \
  "${needs_compiled[@]/#/--ignore=}" "${left_out[@]}" "$@" "${tested[@]}" | sed -u "s/^/Noetic's versions: /"
