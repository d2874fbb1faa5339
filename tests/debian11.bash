#!/usr/bin/env bash
# Builds the suite in a root of Debian 11 and runs there the quick tests, the C++ tests, a rostest
# and the test in RViz; `make test-debian11`. Its Ceres 1.14, PCL 1.11, RViz 1.14.4, CMake 3.18 and
# Python 3.9 are the nearest to ROS Noetic's that Debian has.
#
# The root is made once, from the mirror that this machine's apt uses, in .debian11, or in the
# folder that ATOM_DEBIAN11_ROOT names (7 GB). ATOM_DEBIAN11_MIRROR names another mirror.
# What is mounted is so for these processes alone: nothing stays behind, however they end.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$(realpath -m "${ATOM_DEBIAN11_ROOT:-.debian11}")
rostest=atom_calibration_rostest_tests_calibrate.test

stop() {
  printf 'test-debian11: %s\n' "$1" >&2
  exit 2
}

say() { printf 'Debian 11: %s\n' "$*"; }

# ---- inside: $1 is --inside; `unshare` below has made the mounts and processes our own

in_root() { # COMMAND...: in the folder of the suite, with nothing of the caller's environment
  mapfile -t pip_settings < <(env | grep '^PIP_' || true)
  chroot "$root" /usr/bin/env -i HOME=/tmp LANG=C.UTF-8 CCACHE_DIR=/var/cache/ccache \
    PATH=/usr/sbin:/usr/bin:/sbin:/bin "${pip_settings[@]}" \
    bash -c 'cd /suite 2>/dev/null || cd /; exec "$@"' in_root "$@"
}

mirror() {
  local codename
  codename=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
  # shellcheck disable=SC2016
  apt-get indextargets --format '$(RELEASE) $(COMPONENT) $(REPO_URI)' |
    awk -v release="$codename" '$1 == release && $2 == "main" { print $3; exit }'
}

make_root() {
  local from=${ATOM_DEBIAN11_MIRROR:-$(mirror)}
  [ -n "$from" ] || stop "apt of this machine names no mirror of Debian; ATOM_DEBIAN11_MIRROR=URL does"
  say "makes the root in $root"
  rm -rf "$root.unfinished"
  debootstrap --variant=minbase --include=ca-certificates bullseye "$root.unfinished" "$from" >"$root.log" 2>&1 ||
    stop "debootstrap failed; its last words (all of them: $root.log): $(tail -n 2 "$root.log")"
  mv "$root.unfinished" "$root"
}

# The network as this machine reaches it: names, proxies, certificates.
connect_root() {
  mkdir -p "$root/etc/apt/apt.conf.d"
  cp -L /etc/hosts /etc/resolv.conf "$root/etc/"
  cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
  apt-config dump | grep -E '^Acquire::(http|https|ftp)::' >"$root/etc/apt/apt.conf.d/90machine" || true
  [ ! -r /etc/pip.conf ] || cp -L /etc/pip.conf "$root/etc/pip.conf"
}

# The sources as they stand here, without what is built; what is built there stays.
copy_suite() {
  mkdir -p "$root/suite"
  find "$root/suite" -mindepth 1 -maxdepth 1 ! -name build ! -name devel ! -name .venv -exec rm -rf {} +
  git ls-files -z --cached --others --exclude-standard --deduplicate |
    xargs -0 ls -d 2>/dev/null | tar -c --no-recursion --files-from - | tar -x --no-same-owner -C "$root/suite"
}

versions() {
  in_root bash -c "
    dpkg-query --show --showformat '\${Package} \${Version}\n' \
      cmake g++ python3 libceres-dev libpcl-dev libeigen3-dev rviz catkin pybind11-dev \
      python3-opencv python3-numpy python3-scipy" | sed 's/^/Debian 11: /'
}

# Debian 11's rospy, roslaunch and rosunit ask threads `isAlive()`, which its Python 3.9 has no more:
# programs that end well end with 1. Later versions, and Noetic's, have the name that is left.
mend_ros() {
  sed -i 's/\.isAlive()/.is_alive()/' \
    "$root"/usr/lib/python3/dist-packages/{rospy/core,roslaunch/pmon,rosunit/pmon}.py
}

failed=()
step() { # NAME COMMAND...
  say "$1"
  local begun=$SECONDS
  in_root "${@:2}" </dev/null || failed+=("$1")
  say "$1: $((SECONDS - begun)) s"
}

inside() {
  [ -e "$root" ] || make_root
  grep -q '^11\.' "$root/etc/debian_version" 2>/dev/null || stop "$root is no root of Debian 11"
  mount -t proc proc "$root/proc"
  mount --rbind /dev "$root/dev"
  connect_root
  copy_suite
  in_root bash -c 'command -v make >/dev/null || { apt-get -q update &&
    DEBIAN_FRONTEND=noninteractive apt-get -q install --yes --no-install-recommends make; }' >"$root.log" 2>&1 ||
    stop "apt-get failed in the root; its last words (all of them: $root.log): $(tail -n 2 "$root.log")"
  step "set-up" make setup
  [ "${#failed[@]}" -eq 0 ] || stop "the set-up failed; no test was run"
  mend_ros
  versions
  # catkin 0.8.9 takes googletest for found when it configures again, and then links nothing.
  in_root rm -f build/CMakeCache.txt build/build.ninja
  step "build" make build
  [ "${#failed[@]}" -eq 0 ] || stop "the build failed; no test was run"
  step "quick tests" make test-quick
  step "tests' build" bash -c 'source ./env.bash; cmake --build build -j "$(nproc)" --target tests'
  step "C++ tests and a rostest" bash -c 'source ./env.bash; cd build
    ROS_HOME=$PWD/ros_home ctest --output-on-failure -R "_gtest_|'"$rostest"'"'
  step "test in RViz" make test-rviz
  if [ "${#failed[@]}" -gt 0 ]; then
    printf -v names '%s, ' "${failed[@]}"
    stop "failed: ${names%, }"
  fi
  say "all is well"
}

if [ "${1:-}" = --inside ]; then
  inside
  exit
fi

[ "$(id -u)" -eq 0 ] || stop "chroot and mounts need root: sudo make test-debian11"
git rev-parse --git-dir >/dev/null 2>&1 || stop "the list of sources comes from git; this is no clone"
if ! command -v debootstrap >/dev/null; then
  DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300 install --yes --no-install-recommends debootstrap >/dev/null ||
    stop "debootstrap is not installed, and apt-get cannot install it"
fi
mkdir -p "$(dirname "$root")"
exec 9>"$root.lock"
flock --nonblock 9 || stop "another run uses $root; ATOM_DEBIAN11_ROOT names another folder"
unshare --mount --pid --fork --kill-child bash "$PWD/tests/debian11.bash" --inside
