#!/usr/bin/env bash
# Ours beside the broad phases of others, on the same boxes: builds what is needed, runs every scene at 1,000, 10,000
# and 100,000 bodies and gas and static1 at 1,000,000, one process a run, and writes benches/results/broad.csv.
# Needs Rust. Takes about an hour; leave the machine alone meanwhile. Arguments are passed on, and then nothing is
# saved unless they say so:  ./run.sh --bodies 10000 --scene gas,pile --method order,parry
set -euo pipefail
cd "$(dirname "$0")"

cargo build --release
peers=${CARGO_TARGET_DIR:-target}/release/sweepd-peers
if [ $# -gt 0 ]; then
  exec "$peers" "$@"
fi
"$peers" --save
cp ../results/broad.csv /tmp/sweepd-broad.$$
"$peers" --bodies 1000000 --scene gas,static1 --method limit,order,parry,rapier | tail -n +2 >>/tmp/sweepd-broad.$$
mv /tmp/sweepd-broad.$$ ../results/broad.csv
