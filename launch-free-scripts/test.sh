#!/usr/bin/env bash
# Runs all tests: Rust (unit, law, oracle, transport), and Python (the client and the MuJoCo bridge against a live daemon).
#
#   ./launch-free-scripts/test.sh [--rust-only]
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
cd "$root"

if [ "${1:-}" != --rust-only ]; then
  # What the Python side needs, in an environment of its own.
  venv=$root/.venv-test
  [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check pytest mujoco ./msgs/python
  export SWEEPD_PYTHON=$venv/bin/python
fi

cargo test --no-fail-fast
# Tests against oracles count their cases by build: the large counts run here.
cargo test --release --no-fail-fast --test engine --test soundness --test exact_pairs --test mesh_pairs \
  --test broad_phase --test geometry_cases

if [ "${1:-}" != --rust-only ]; then
  cargo build --quiet --release --bin sweepd
  SWEEPD=${CARGO_TARGET_DIR:-$root/target}/release/sweepd "$SWEEPD_PYTHON" -m pytest -q tests/python
fi
