#!/usr/bin/env bash
# Runs the unit tests of what calls C and C++ (backend::embree, texture, film::oidn) under valgrind's memcheck: no read
# or write outside of memory that is whose, no use of what nobody wrote, nothing lost. Usage: scripts/memcheck.sh
# [FILTER ...]
# Needs valgrind (scripts/setup.sh gates). The tests are those that `make test` builds, and are built here if they are
# not there. What the dynamic linker keeps is left out (scripts/memcheck.supp) and nothing else: Embree 3.13.5 and
# OpenImageIO 2.4.7 make no noise in what these tests call. AVX-512 is nothing that valgrind knows: AVX2 is what runs.
# Exit code 0 if nothing was found.

set -euo pipefail
cd "$(dirname "$(dirname "$(readlink -f "$0")")")"
# Left out: two that make the same calls as others with so many rays that they take minutes.
[ $# -gt 0 ] || set -- backend::embree texture:: film::oidn --skip neighbours

command -v valgrind >/dev/null || { echo 'memcheck: no valgrind; run: scripts/setup.sh gates' >&2; exit 2; }
built=$(cargo test --workspace --lib --no-run 2>&1) || { printf '%s\n' "$built" >&2; exit 1; }
tests=$(sed -n 's/.*Executable.*(\(.*\/deps\/pathspace-[0-9a-f]*\))$/\1/p' <<<"$built")
[ -x "$tests" ] || { printf '%s\nmemcheck: no tests among what was built\n' "$built" >&2; exit 1; }

# One test at a time: valgrind runs one thread at a time anyway.
started=$SECONDS
RUST_TEST_THREADS=1 valgrind --quiet --error-exitcode=99 --num-callers=24 --fair-sched=try \
  --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite \
  --suppressions=scripts/memcheck.supp "$tests" "$@"
echo "memcheck: nothing found, $((SECONDS - started)) s"
