#!/usr/bin/env bash
# The static half of the gate: format, lints and docs; every warning is an error.
set -euo pipefail
cd "$(dirname "$0")/.."
export RUSTFLAGS="${RUSTFLAGS:-} -D warnings" RUSTDOCFLAGS="-D warnings"

cargo fmt --all -- --check
cargo clippy --all-targets
cargo doc --no-deps --document-private-items
for script in launch-free-scripts/*.sh .ci/run .ci/*.sh; do bash -n "$script"; done
