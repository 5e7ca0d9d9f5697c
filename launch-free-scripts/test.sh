#!/usr/bin/env bash
# Runs all tests: Rust (unit, law, oracle, transport) and Python (the client, the MuJoCo bridge, a soak of the whole
# system, and real ROS 2 peers against a live daemon). With SWEEPD_CI_SLOW=1 the soak is long. If the ROS 2 peers cannot
# be set up (no Python 3.11, not x86-64), the script says so and goes on; with SWEEPD_ROS2=required that is a failure.
#
#   ./launch-free-scripts/test.sh [--rust-only]
set -euo pipefail

case "$*" in
  ''|--rust-only) ;;
  -h|--help) sed -n '2,/^set /p' "$0" | sed '$d; s/^# \{0,1\}//'; exit 0 ;;
  *) echo "test.sh: $*: there is --rust-only, and nothing else" >&2; exit 2 ;;
esac

here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
cd "$root"

if [ "${1:-}" != --rust-only ]; then
  # What the Python tests need, in an environment of its own.
  venv=$root/.venv-test
  [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check pytest pytest-xdist mujoco \
    mcap mcap-ros2-support ./msgs/python
  export SWEEPD_PYTHON=$venv/bin/python
fi

# Tests against oracles count their cases by build: these run with the large counts, in release. Soundness and sweep
# also run in a debug build, with its checks of assertions and overflows; with SWEEPD_CI_SLOW=1 (and by a plain
# `cargo test`) all of them do, with the small counts.
counted=(alloc engine exact_pairs mesh_pairs broad_phase geometry_cases mesh_manifolds regions)
both=(soundness sweep)
others=()
for file in tests/*.rs tests/*/main.rs; do
  name=${file#tests/} name=${name%/main.rs} name=${name%.rs}
  [[ " ${counted[*]} " == *" $name "* ]] || others+=(--test "$name")
done
if [ "${SWEEPD_CI_SLOW:-}" = 1 ]; then
  cargo test --no-fail-fast
else
  cargo test --no-fail-fast --lib --bins "${others[@]}"
  cargo test --doc
fi
cargo test --release --no-fail-fast "${counted[@]/#/--test=}" "${both[@]/#/--test=}"

if [ "${1:-}" != --rust-only ]; then
  cargo build --quiet --release --bin sweepd
  # A few at a time: they mostly wait for messages, and those over DDS nearly always do.
  SWEEPD=${CARGO_TARGET_DIR:-$root/target}/release/sweepd "$SWEEPD_PYTHON" -m pytest -q -n 2 tests/python --ignore tests/python/ros2
  ros2=$("$here/ros2_env.sh") && code=0 || code=$?
  if [ "$code" = 0 ]; then
    # Those that measure how much of a core is used, or how much comes through, run alone.
    load=tests/python/ros2/test_load.py
    export SWEEPD=${CARGO_TARGET_DIR:-$root/target}/release/sweepd
    "$ros2" -m pytest -q -n 4 -p no:cacheprovider tests/python/ros2 --ignore "$load"
    "$ros2" -m pytest -q -p no:cacheprovider "$load"
  elif [ "$code" = 3 ] && [ "${SWEEPD_ROS2:-}" != required ]; then
    echo "the tests with ROS 2 peers are skipped: see above"
  else
    exit 1
  fi
fi
