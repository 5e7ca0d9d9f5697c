#!/usr/bin/env bash
# The demo as a user meets it: collisions and contacts are seen, it ends by itself and at Ctrl-C, and nothing is left: no
# process, no file in shared memory.
set -euo pipefail
cd "$(dirname "$0")/.."

log=$(mktemp)
trap 'rm -f "$log"' EXIT
fail() { cat "$log"; echo "demo: $*" >&2; exit 1; }

# What cannot be meant is said before anything is built.
for script in demo ros2_demo; do
  for wrong in "--seconds abc" "--seconds 0" "--seconds" "--second 4"; do
    code=0
    # shellcheck disable=SC2086
    ./launch-free-scripts/$script.sh $wrong >"$log" 2>&1 || code=$?
    [ "$code" = 2 ] && head -1 "$log" | grep -q "^$script.sh: .*--second" || fail "$script.sh $wrong ended with $code"
  done
done

./launch-free-scripts/demo.sh --seconds 4 | tee "$log" || fail "it failed"
grep -Eq 'with colliding pairs: [1-9][0-9]*; with contacts: [1-9]' "$log" || fail "no collisions, or no contacts"

# A frame time kept: how many frames are late is the machine's matter here, that each has its result is not.
./launch-free-scripts/demo.sh --deadline --seconds 2 | tee "$log" || fail "it failed with --deadline"
grep -q ' of 100 frames over 20.0 ms; .*; 0 without a result' "$log" || fail "frames without a result"

# Ctrl-C: a signal to the whole process group, as a terminal sends it; who starts this may have it ignored.
# What the first run wrote is out of the log before anything is looked for in it: the new one opens it in its own time.
: >"$log"
set -m
env --default-signal=INT ./launch-free-scripts/demo.sh --seconds 100 >"$log" 2>&1 & demo=$!
set +m
for _ in $(seq 600); do
  grep -q ' colliding' "$log" && break
  kill -0 "$demo" 2>/dev/null || fail "it ended before Ctrl-C"
  sleep 0.1
done
kill -INT -- "-$demo"
code=0
wait "$demo" || code=$?
[ "$code" = 130 ] || fail "Ctrl-C ended it with code $code"
! grep 'left behind' "$log" || fail "Ctrl-C left files"
# Its processes have its instance, which its process number names, among their arguments.
! ps -eo args | grep "[d]emo_$demo" || fail "Ctrl-C left processes"
echo "the demo ended at Ctrl-C, and left nothing"
