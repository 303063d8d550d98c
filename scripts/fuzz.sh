#!/usr/bin/env bash
# Feeds mutated scene files to the loader for a while, guided by coverage. Usage: scripts/fuzz.sh [SECONDS]      (60 by default)
# The target is cargo-fuzz's (fuzz/fuzz_targets/gltf.rs), built here without cargo-fuzz and without a nightly compiler: LLVM's coverage
# pass is a stable codegen option, and libFuzzer comes as a crate. What only a nightly has, AddressSanitizer, finds little in code
# without `unsafe`. Needs a C++ compiler (scripts/setup.sh fuzz). Exit code 0 if nothing was found; else the file that
# broke the loader lies in fuzz/target/. Inputs that reached new code are kept in fuzz/target/corpus and used again.

set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/../fuzz"

readonly SECONDS_MAX=${1:-60}
host=$(rustc -vV | sed -n 's/^host: //p')
readonly host

# Flags for the target alone, so that build scripts and macros are built without.
flags=(
  --cfg fuzzing -C codegen-units=1 -C target-cpu=x86-64-v3
  -C passes=sancov-module
  -C llvm-args=-sanitizer-coverage-level=4
  -C llvm-args=-sanitizer-coverage-inline-8bit-counters
  -C llvm-args=-sanitizer-coverage-pc-table
  -C llvm-args=-sanitizer-coverage-trace-compares
)
export CARGO_TARGET_DIR=${PATHSPACE_FUZZ_TARGET:-$PWD/target}
RUSTFLAGS="${flags[*]}" cargo build --release --target "$host" --bin gltf

corpus=$CARGO_TARGET_DIR/corpus
mkdir -p "$corpus"
# The seeds are read only; what is found goes into the corpus. One input that takes 20 s or 2 GB is a finding as well.
"$CARGO_TARGET_DIR/$host/release/gltf" "$corpus" seeds/gltf \
  -dict=gltf.dict -artifact_prefix="$CARGO_TARGET_DIR/" -seed=1 -max_len=16384 -timeout=20 -rss_limit_mb=2048 \
  -max_total_time="$SECONDS_MAX" -print_final_stats=1
