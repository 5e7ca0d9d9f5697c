#!/usr/bin/env bash
# Shows sweepd at work: a daemon, a source that moves bodies, and a monitor, each a process of its own, connected by
# shared memory. It ends by itself (or at Ctrl-C) and leaves nothing behind.
#
#   ./launch-free-scripts/demo.sh [--seconds N] [--count N] [--pile] [--deadline] [--mujoco [MODEL.xml]]
#
#   --seconds N   how long to run (default 10)
#   --count N     bodies of the built-in scene (default 60)
#   --pile        bodies on a floor instead of bodies in free space
#   --deadline    a source that works 7 to 15 ms of each frame and leaves the rest of its 20 ms to the daemon (2,000
#                 bodies unless --count says otherwise); prints a table of when the results were there
#   --mujoco      a real simulator as the source; installs MuJoCo into a virtual environment of its own (.venv-demo)
#
# The script builds sweepd without ROS 2 and recording. Set SWEEPD=FILE to use a binary that is already built.
set -euo pipefail

usage() { sed -n '2,/^set /p' "$0" | sed '$d; s/^# \{0,1\}//'; }

# The value of an option, which must be a whole number from 1 on.
number() {
  [[ ${2:-} =~ ^[1-9][0-9]{0,8}$ ]] || { echo "demo.sh: $1${2:+ $2}: give a whole number from 1 on" >&2; exit 2; }
  echo "$2"
}

seconds=10 count='' kind=pool deadline='' mujoco='' model=''
while [ $# -gt 0 ]; do
  case "$1" in
    --seconds) seconds=$(number "$@"); shift 2 ;;
    --count) count=$(number "$@"); shift 2 ;;
    --pile) kind=pile; shift ;;
    --deadline) deadline=yes; shift ;;
    --mujoco) mujoco=yes; shift; if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then model=$1; shift; fi ;;
    -h|--help) usage; exit 0 ;;
    *) echo "demo.sh: unknown option $1" >&2; usage >&2; exit 2 ;;
  esac
done

here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
instance="demo_$$"
work=$(mktemp -d)
pids=()
interrupted=''

# Files in shared memory that our processes have mapped; iceoryx2 keeps one of its own forever.
mapped() {
  for pid in "${pids[@]}"; do cat "/proc/$pid/maps" 2>/dev/null || true; done \
    | grep -o '/dev/shm/[^ ]*' | grep -v global_mgmt | sort -u || true
}

any_runs() {
  for pid in "${pids[@]}"; do ! kill -0 "$pid" 2>/dev/null || return 0; done
  return 1
}

finish() {
  trap - EXIT INT TERM
  local files left
  files=$(mapped)
  # Ctrl-C goes to all of them: a second signal would cut their shutdown short.
  for _ in $(seq 30); do
    [ -n "$interrupted" ] && any_runs || break
    sleep 0.1
  done
  for pid in "${pids[@]}"; do kill -INT "$pid" 2>/dev/null || true; done
  for pid in "${pids[@]}"; do wait "$pid" 2>/dev/null || true; done
  rm -rf "$work"
  left=$(for file in $files; do [ ! -e "$file" ] || echo "$file"; done
    grep -ls "$instance/" /tmp/iceoryx2/services/* 2>/dev/null || true)
  if [ -n "$left" ]; then
    printf 'demo.sh: left behind: %s\n' $left >&2
    exit 1
  fi
}

# Runs what is watched until it ends, beside the script and not in the foreground: if a program in the foreground takes
# a Ctrl-C as its own end, the shell hears nothing of it and would go on.
watch() {
  "$@" & pids+=($!)
  wait "$!"
}
trap finish EXIT
trap 'interrupted=yes; exit 130' INT
trap 'exit 143' TERM

sweepd=${SWEEPD:-}
if [ -z "$sweepd" ]; then
  echo "building (the first time takes a few minutes)"
  cargo build --quiet --release --no-default-features --features tui --manifest-path "$root/Cargo.toml" --bin sweepd
  sweepd=${CARGO_TARGET_DIR:-$root/target}/release/sweepd
fi

if [ -n "$mujoco" ]; then
  venv=$root/.venv-demo
  [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check mujoco "$root/msgs/python"
  exec_model=${model:-$here/models/robot.xml}
  "$venv/bin/python" "$here/mujoco_bridge.py" "$exec_model" --spawn "$sweepd" --instance "$instance" --steps 500 --compare
  exit 0
fi

scene=$work/scene.toml
if [ -n "$deadline" ]; then
  "$sweepd" feed --write-scene "$scene" --kind "$kind" --count "${count:-2000}" --seed 7
  "$sweepd" --quiet run "$scene" --instance "$instance" --mode on_frame=feed --budget none & pids+=($!)
  # A listener: without one there is nothing to compute but verdicts.
  "$sweepd" --quiet monitor --instance "$instance" --contacts --json >"$work/ticks.jsonl" & pids+=($!)
  watch "$sweepd" --quiet feed "$scene" --instance "$instance" --rate 50 --work 7ms..15ms --frames "$((seconds * 50))"
  finish
  echo "done: daemon, source and monitor have ended, shared memory is clean"
  exit 0
fi
# How many lines of what was heard until the end contain this.
heard() { grep -c "$1" "$work/heard.jsonl" || true; }

"$sweepd" feed --write-scene "$scene" --kind "$kind" --count "${count:-60}" --seed 7
"$sweepd" check "$scene"
"$sweepd" --quiet run "$scene" --instance "$instance" --budget 2ms & pids+=($!)
"$sweepd" --quiet feed "$scene" --instance "$instance" --rate 100 & pids+=($!)
"$sweepd" --quiet monitor --instance "$instance" --contacts --json >"$work/ticks.jsonl" & pids+=($!)
watch timeout --foreground -s INT "$seconds" "$sweepd" monitor --instance "$instance" --contacts --pairs 12 || [ $? -eq 124 ]
echo
echo "one tick as JSON:"
"$sweepd" monitor --instance "$instance" --json --ticks 1 --pairs 2
echo
cp "$work/ticks.jsonl" "$work/heard.jsonl"
echo "$(heard '"tick":') ticks heard; with colliding pairs: $(heard '"colliding":[1-9]'); with contacts: $(heard '"contacts":\[{')"
finish
echo "done: daemon, source and monitor have ended, shared memory is clean"
