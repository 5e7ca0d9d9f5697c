#!/usr/bin/env bash
# Ours beside the broad phases of others, on the same boxes: builds what is needed, runs every scene at 1,000, 10,000
# and 100,000 bodies and gas and static1 at 1,000,000, one process a run, and writes benches/results/broad.csv.
# Takes some hours; leave the machine alone meanwhile. Arguments are passed on, and then nothing is saved unless they
# say so:  ./run.sh --bodies 10000 --scene gas,pile --method order,parry,physx-abp
#
# Needs Rust. For the peers in C++ (PhysX, Bullet, Jolt) it installs by apt-get what is not there of make, g++, cmake,
# clang, libclang-dev and libbullet-dev, and builds for some ten minutes.  ./run.sh --rust-only ..  leaves them out.
set -euo pipefail
cd "$(dirname "$0")"

features=(--features cpp)
large=limit,order,parry,rapier,physx-abp,jolt-active
if [ "${1-}" = --rust-only ]; then
  shift
  features=()
  large=limit,order,parry,rapier
else
  missing=()
  command -v make >/dev/null || missing+=(make)
  command -v c++ >/dev/null || missing+=(g++)
  command -v cmake >/dev/null || missing+=(cmake)
  command -v clang++ >/dev/null || missing+=(clang)
  for package in libclang-dev libbullet-dev; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q ' installed$' || missing+=("$package")
  done
  if [ ${#missing[@]} -gt 0 ]; then
    as_root=()
    [ "$(id -u)" = 0 ] || as_root=(sudo -n)
    if ! command -v apt-get >/dev/null || ! "${as_root[@]}" true 2>/dev/null; then
      echo "run.sh: the peers in C++ need ${missing[*]}, which may not be installed from here:" \
        "install them, or run with --rust-only." >&2
      exit 1
    fi
    "${as_root[@]}" apt-get update >&2
    "${as_root[@]}" apt-get install -y --no-install-recommends "${missing[@]}" >&2
  fi
fi

cargo build --release "${features[@]}"
peers=${CARGO_TARGET_DIR:-target}/release/sweepd-peers
if [ $# -gt 0 ]; then
  exec "$peers" "$@"
fi
"$peers" --save
cp ../results/broad.csv /tmp/sweepd-broad.$$
"$peers" --bodies 1000000 --scene gas,static1 --method "$large" | tail -n +2 >>/tmp/sweepd-broad.$$
mv /tmp/sweepd-broad.$$ ../results/broad.csv
