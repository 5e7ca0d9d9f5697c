#!/usr/bin/env bash
# Shows sweepd as a ROS 2 node: the daemon, an rclpy publisher that moves two robots through each other (one by
# ~/transforms, one by /tf), and an rclpy subscriber that prints the pairs. It ends by itself (or at Ctrl-C) and leaves
# nothing behind. No ROS 2 installation is needed: rclpy comes from PyPI (see ros2_env.sh).
#
#   ./launch-free-scripts/ros2_demo.sh [--seconds N]
#
#   --seconds N   how long to run (default 15)
#
# Meanwhile you can watch it in RViz or Foxglove (see README). ROS_DOMAIN_ID is used as it is set. The node stays on
# loopback unless ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET.
set -euo pipefail

usage() { sed -n '2,/^set /p' "$0" | sed '$d; s/^# \{0,1\}//'; }

# The value of an option, which must be a whole number from 1 on.
number() {
  [[ ${2:-} =~ ^[1-9][0-9]{0,8}$ ]] || { echo "ros2_demo.sh: $1${2:+ $2}: give a whole number from 1 on" >&2; exit 2; }
  echo "$2"
}

seconds=15
while [ $# -gt 0 ]; do
  case "$1" in
    --seconds) seconds=$(number "$@"); shift 2 ;;
    -h|--help) usage; exit 0 ;;
    *) echo "ros2_demo.sh: unknown option $1" >&2; usage >&2; exit 2 ;;
  esac
done

here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
pids=()

finish() {
  trap - EXIT INT TERM
  for pid in "${pids[@]}"; do kill -INT "$pid" 2>/dev/null || true; done
  for pid in "${pids[@]}"; do wait "$pid" 2>/dev/null || true; done
}
trap finish EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

python=$("$here/ros2_env.sh")
echo "building (the first time takes a few minutes)"
cargo build --quiet --release --manifest-path "$root/Cargo.toml" --bin sweepd
sweepd=${CARGO_TARGET_DIR:-$root/target}/release/sweepd

"$sweepd" check "$here/ros2/robots.toml"
"$sweepd" --quiet run "$here/ros2/robots.toml" --instance "ros2_demo_$$" --ros2 & pids+=($!)
"$python" "$here/ros2/move_robots.py" --same-host --seconds "$((seconds + 5))" & pids+=($!)
code=0
"$python" "$here/ros2/print_pairs.py" --seconds "$seconds" || code=$?
finish
echo "done: the node, the publisher and the subscriber have ended, shared memory is clean"
exit "$code"
