#!/usr/bin/env bash
# Feeds mutated files to the loader for a while, guided by coverage. Usage: scripts/fuzz.sh [gltf | images] [SECONDS |
# INPUT]
#   gltf     scene files (the default); images: image files, through the crates and through OpenImageIO
#   SECONDS  how long, 60 by default; the first random number is always the same
#   INPUT    a file: loads it once, which is how a finding is replayed
# The targets are cargo-fuzz's (fuzz/fuzz_targets), built by the stable compiler without cargo-fuzz: LLVM's coverage
# pass is a stable codegen option, and libFuzzer comes as a crate. One flag here is not stable, hence RUSTC_BOOTSTRAP
# for this build alone: -Zhint-mostly-unused compiles of each crate only what the targets call, so that the kernels,
# which the loader never calls, cost nothing (under 3 minutes of processor time instead of 6). What only a nightly has,
# AddressSanitizer, finds little in code without `unsafe`. Needs a C++ compiler and OpenImageIO (scripts/setup.sh fuzz).
# Writes to fuzz/target (or PATHSPACE_FUZZ_TARGET) alone; inputs that reached new code are kept in its folders
# corpus-TARGET and used again. Exit code 0 if nothing was found; else the last lines say which input broke the loader,
# and how to replay it.

set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "$0")")")
readonly root

name=gltf
case "${1:-}" in
  gltf | images) name=$1; shift ;;
esac
seconds=60 input=
case "${1:-}" in
  '') ;;
  *[!0-9]*)
    input=$(readlink -e -- "$1") || {
      printf 'fuzz: %s is neither a number of seconds nor a file\n' "$1" >&2
      exit 2
    } ;;
  *) seconds=$1 ;;
esac
[ "$((10#$seconds))" -gt 0 ] || { printf 'fuzz: 0 seconds are too few; at least 1\n' >&2; exit 2; }
cd "$root/fuzz"
host=$(rustc -vV | sed -n 's/^host: //p')
readonly host

# Flags for the target alone, so that build scripts and macros are built without.
flags=(
  --cfg fuzzing
  -C passes=sancov-module
  -C llvm-args=-sanitizer-coverage-level=4
  -C llvm-args=-sanitizer-coverage-inline-8bit-counters
  -C llvm-args=-sanitizer-coverage-pc-table
  -C llvm-args=-sanitizer-coverage-trace-compares
)
# A compiler that no longer knows the flag takes longer, and that is all.
! RUSTC_BOOTSTRAP=1 rustc -Z hint-mostly-unused --print sysroot >/dev/null 2>&1 || flags+=(-Z hint-mostly-unused)
[ "${host%%-*}" != x86_64 ] || flags+=(-C target-cpu=x86-64-v3)
export CARGO_TARGET_DIR=${PATHSPACE_FUZZ_TARGET:-$PWD/target} CARGO_INCREMENTAL=0
RUSTC_BOOTSTRAP=1 RUSTFLAGS="${flags[*]}" cargo build --locked --release --target "$host" --features images \
  --bin gltf --bin images

# Where the target writes its bytes for the loader to read.
export TMPDIR=$CARGO_TARGET_DIR/scratch
mkdir -p "$TMPDIR"
rm -f "$TMPDIR"/pathspace-fuzz-*

# One input that takes 20 s or 2 GB is a finding as well.
target=("$CARGO_TARGET_DIR/$host/release/$name" -timeout=20 -rss_limit_mb=2048)
[ -z "$input" ] || exec "${target[@]}" "$input"

# The seeds are read only; what is found goes into the corpus. What earlier runs found broken would be taken for this
# run's.
corpus=$CARGO_TARGET_DIR/corpus-$name findings=$CARGO_TARGET_DIR/findings
mkdir -p "$corpus" "$findings"
rm -f "$findings"/*
log=$CARGO_TARGET_DIR/fuzz.log
# Images have no words that repeat.
words=()
[ ! -f "$name.dict" ] || words=(-dict="$name.dict")
# (New inputs are not told one by one: a line now and then says how far it is.)
status=0
"${target[@]}" "$corpus" "seeds/$name" "${words[@]}" -artifact_prefix="$findings/" -seed=1 -max_len=16384 \
  -max_total_time="$seconds" -print_final_stats=1 -verbosity=1 >"$log" 2>&1 || status=$?
grep -E '^#[0-9]+[[:space:]]+(INITED|pulse|DONE)|^stat::' "$log" || true
[ $status -ne 0 ] || exit 0

tail -n 60 "$log" | cut -c 1-400 >&2
for found in "$findings"/*; do
  [ -f "$found" ] || continue
  printf '\nfuzz: FAILED: %s broke the loader\nfuzz: replay it with: scripts/fuzz.sh %s %s\n' "$found" \
    "$name" "$found" >&2
  # The machine may be gone when somebody reads this.
  printf 'fuzz: or, anywhere, with: base64 -d <<<%s | gunzip >finding && scripts/fuzz.sh %s finding\n' \
    "$(gzip -9 <"$found" | base64 -w 0)" "$name" >&2
done
exit $status
