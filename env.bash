# Environment of the suite: `source env.bash`, from any folder, as often as you like.
#
# Puts first on PATH the virtual environment (made by `make setup`), which sees Debian's ROS
# modules; removes what makes another Python answer to `python3`; then sources the devel space of
# this checkout: ./devel after `make build`, or that of the catkin workspace it is cloned into.
# Before the first build it prepares the shell for `catkin_make`.

if [ -z "${BASH_VERSION:-}" ]; then
  echo "env.bash: needs bash" >&2
  return 2
fi

_atom_env() {
  local root
  root=$(dirname -- "$(realpath -- "${BASH_SOURCE[0]}")")

  # Other Pythons off the PATH (pyenv, an active conda or virtual environment), our own in front.
  local entry kept="" entries
  IFS=: read -r -a entries <<<"$PATH"
  for entry in "${entries[@]}"; do
    case "$entry/" in
      "$root/.venv/bin/" | */.pyenv/* | "${PYENV_ROOT:-/nowhere}"/* | \
        "${VIRTUAL_ENV:-/nowhere}"/* | "${CONDA_PREFIX:-/nowhere}"/*) ;;
      *) kept="${kept:+$kept:}$entry" ;;
    esac
  done
  PATH=$kept
  unset PYTHONPATH PYTHONHOME VIRTUAL_ENV PYENV_VERSION
  if [ -x "$root/.venv/bin/python3" ]; then
    PATH="$root/.venv/bin:$PATH"
  elif [ "$(command -v python3)" != /usr/bin/python3 ]; then
    PATH="/usr/bin:$PATH"
  fi
  export PATH
  hash -r

  # The scripts sourced below read unset variables and let commands fail.
  local flags=$-
  set +eu

  # roscd, rosls and completion, which Debian does not load by itself.
  local rosbash=/usr/share/bash-completion/completions/rosbash
  if [[ $flags == *i* && -r $rosbash ]]; then
    # shellcheck disable=SC1090
    source "$rosbash"
  fi

  local devel found=""
  for devel in "$root/devel" "$root/../../devel" /opt/ros/noetic; do
    if [ -f "$devel/.catkin" ] && [ -f "$devel/setup.bash" ]; then
      found=$(realpath -- "$devel")
      # shellcheck disable=SC1091
      source "$found/setup.bash"
      break
    fi
  done

  case $flags in *u*) set -u ;; esac
  case $flags in *e*) set -e ;; esac
  case $found in
    "" | /opt/*) echo "env.bash: not built yet; run 'make build' here, or catkin_make in your workspace" >&2 ;;
  esac
}

_atom_env
unset -f _atom_env
