#!/usr/bin/env bash
# System packages (apt.txt) and the virtual environment .venv (pip.txt). Does only what is missing.
# On Debian 12; on Debian 11, too, for `make test-debian11`, with debian11.txt in place of pip.txt.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV PYENV_VERSION

stop() {
  printf 'setup: %s\n' "$1" >&2
  exit 2
}

release=$(. /etc/os-release && printf '%s %s' "${ID:-unknown}" "${VERSION_ID:-}")
case $release in
  "debian 12") wanted_of_pypi=requirements/pip.txt versions=requirements/constraints.txt ;;
  "debian 11") wanted_of_pypi=requirements/debian11.txt versions=/dev/null ;;
  *) stop "this machine is '$release'; apt.txt names the packages of Debian 12 and 11. \
Elsewhere install the dependencies of the package.xml files and build with catkin_make (CONTRIBUTING.md)." ;;
esac

# An unknown package makes dpkg-query fail; it is simply not in its answer.
mapfile -t wanted < <(sed 's/#.*//' requirements/apt.txt | xargs -n 1)
installed=$(dpkg-query --show --showformat '${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null || true)
missing=()
for package in "${wanted[@]}"; do
  grep -qx "installed $package" <<<"$installed" || missing+=("$package")
done
stamp=.venv/made_of.sha256
checksum=$(cat "$wanted_of_pypi" "$versions" | sha256sum)
venv_is_current() { [ "$(cat "$stamp" 2>/dev/null)" = "$checksum" ] && .venv/bin/python3 -c '' 2>/dev/null; }

if [ "${#missing[@]}" -gt 0 ]; then
  printf 'setup: installs %d Debian packages with apt-get: %s\n' "${#missing[@]}" "${missing[*]}"
fi
venv_is_current || printf 'setup: makes .venv with: %s\n' "$(sed 's/#.*//' "$wanted_of_pypi" | xargs)"

if [ "${#missing[@]}" -gt 0 ]; then
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || stop "installing Debian packages needs root or sudo"
    as_root=(sudo)
  fi
  apt_get=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300)
  "${apt_get[@]}" update
  "${apt_get[@]}" install --yes --no-install-recommends "${missing[@]}"
fi

if ! venv_is_current; then
  /usr/bin/python3 -m venv --clear --system-site-packages .venv
  .venv/bin/python3 -m pip install --quiet --disable-pip-version-check \
    --requirement "$wanted_of_pypi" --constraint "$versions"
  # PyPI's xacro asks ROS 2's index for $(find package); here rospack answers.
  index=$(.venv/bin/python3 -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/ament_index_python
  mkdir -p "$index"
  printf '"""Finds ROS 1 packages for xacro."""\n' >"$index/__init__.py"
  printf '%s\n' '"""Finds ROS 1 packages for xacro."""' '' 'import rospkg' '' '' \
    'def get_package_share_directory(name):' '    """Return the folder of a package."""' \
    '    return rospkg.RosPack().get_path(name)' >"$index/packages.py"
  printf '%s' "$checksum" >"$stamp"
fi
