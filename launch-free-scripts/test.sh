#!/usr/bin/env bash
# Runs all tests: Rust (unit, law, oracle, transport, goldens) and the Python client against a live daemon.
#
#   ./launch-free-scripts/test.sh [--rust-only]
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
cd "$root"

cargo test --no-fail-fast
# Tests against oracles count their cases by build: the large counts run here.
cargo test --release --no-fail-fast --test engine --test soundness --test exact_pairs --test mesh_pairs \
  --test broad_phase --test geometry_cases

if [ "${1:-}" = --rust-only ]; then exit 0; fi

venv=$root/.venv-test
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check pytest mujoco "$root/msgs/python"
cargo build --quiet --release --bin sweepd
SWEEPD=${CARGO_TARGET_DIR:-$root/target}/release/sweepd "$venv/bin/python" -m pytest -q tests/python
