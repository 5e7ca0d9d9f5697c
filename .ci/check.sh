#!/usr/bin/env bash
# The static half of the gate: format, lints, docs and the plan of the house; every warning is an error.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo fmt --all -- --check
cargo fmt --manifest-path benches/peers/Cargo.toml -- --check
cargo clippy --all-targets -- -D warnings
cargo clippy --all-targets --no-default-features -- -D warnings
# Each feature without the others: what one uses of another's goes unseen where all are on, or none is.
for feature in ros2 mcap tui; do
  cargo clippy --lib --bins --no-default-features --features "$feature" -- -D warnings
done
# The lean daemon links nothing of DDS, and records nothing.
lean=$(cargo tree --no-default-features -e normal --prefix none)
if grep -E '^(rustdds|ros2-client|mcap) ' <<<"$lean"; then echo "there without its feature" >&2; exit 1; fi
# Which room names which, and how each file is kept: seconds here, a whole run of the gate if it were told at its end.
cargo test --test rooms
RUSTDOCFLAGS="-D warnings" cargo doc --no-deps
for script in launch-free-scripts/*.sh .ci/run .ci/*.sh; do bash -n "$script"; done
