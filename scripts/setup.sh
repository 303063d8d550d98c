#!/usr/bin/env bash
# Installs what building pathspace needs on Debian 12 and 13, through apt-get, and only what is missing.
# Usage: scripts/setup.sh [nolib | lint | gates | fuzz | browser | farm | packages]
#   nolib: without Embree and OpenImageIO (--no-default-features --features cli)
#                                                     lint: rustfmt and clippy as well, through rustup
#                                                     gates: valgrind as well
#                                                     fuzz: a C++ compiler and OpenImageIO, which the targets need
#                                                     browser: Chromium as well
#                                                     farm: Slurm, openjd-cli from PyPI in target/farm-venv, and what
#                                                       reads and filters pictures (OpenImageIO and NumPy for Python;
#                                                       pyoidn and cryptomatte-api from PyPI, in the same folder)
#                                                     packages: what packing needs, dpkg-dev and Python's venv
# Needs: a Rust toolchain; root or sudo if a package is missing. Changes nothing else, and may be run again at will.

set -euo pipefail

readonly RUST_MIN_MINOR=95 # rust-version in Cargo.toml: 1.95

say() { printf 'setup: %s\n' "$*" >&2; }
fail() { printf 'setup: FAILED: %s\n' "$*" >&2; exit 1; }

installed() { [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }

# A C compiler links every Rust program; Embree's declarations are read from its header with libclang; what stands
# before OpenImageIO is C++.
packages=(gcc libc6-dev make)
# What measuring needs on top.
tools=()
case "${1:-}" in
  nolib) ;;
  fuzz) packages+=(g++ pkg-config libopenimageio-dev) ;;
  '' | lint | gates | browser)
    [ -n "${EMBREE_DIR:-}" ] || packages+=(libembree-dev)
    packages+=(libclang-dev g++ pkg-config libopenimageio-dev)
    [ "${1:-}" != gates ] || tools+=(valgrind)
    [ "${1:-}" != browser ] || tools+=(chromium) ;;
  farm) packages=(); tools+=(slurmctld slurmd slurm-client python3-venv python3-numpy python3-openimageio) ;;
  packages) packages=(gcc libc6-dev make); tools+=(dpkg-dev python3-venv) ;;
  *) fail "unknown argument '$1'; usage: scripts/setup.sh [nolib | lint | gates | fuzz | browser | farm | packages]" ;;
esac

# Rust first: apt-get cannot help with it, Debian's own is too old.
if ! command -v cargo >/dev/null && [ -x "${CARGO_HOME:-${HOME:-}/.cargo}/bin/cargo" ]; then
  fail "cargo is installed but not in PATH; run: . \"${CARGO_HOME:-$HOME/.cargo}/env\""
fi
command -v cargo >/dev/null && command -v rustc >/dev/null ||
  fail "no Rust toolchain found; install one from https://rustup.rs (it needs no root), then run this again"
rust=$(rustc --version | cut -d' ' -f2) || fail "rustc does not run; see its message above"
minor=${rust#*.}; minor=${minor%%.*}
[ "${rust%%.*}" -gt 1 ] || [ "$minor" -ge "$RUST_MIN_MINOR" ] ||
  fail "Rust 1.$RUST_MIN_MINOR or newer is needed, $rust is installed; run: rustup update"

if [ "${1:-}" = lint ] && ! { cargo fmt --version && cargo clippy --version; } >/dev/null 2>&1; then
  command -v rustup >/dev/null || fail "rustfmt or clippy is missing, and there is no rustup to add it"
  say "adding rustfmt and clippy through rustup"
  rustup component add rustfmt clippy >&2 || fail "rustup component add; see its message above"
fi

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  fail "no apt-get here. Install a C++ compiler, pkg-config, libclang, OpenImageIO 2.4 or 2.5 and Embree 3.13 or 4.x" \
    "by your system's means (or set EMBREE_DIR), then: cargo build --release"
fi
# Ends well; of what only Python has, a folder of its own.
finish() {
  local venv; venv=$(dirname "$(readlink -f "$0")")/../target/farm-venv
  if [ "$1" = farm ]; then
    if ! [ -x "$venv/bin/openjd" ]; then
      /usr/bin/python3 -m venv "$venv" && "$venv/bin/pip" install -q openjd-cli==0.8.0 >&2 ||
        fail "openjd-cli cannot be installed by pip; see its message above"
    fi
    local package
    for package in pyoidn==2.5.1.0 cryptomatte-api==1.0.0; do
      "$venv/bin/pip" show -q "${package%%==*}" 2>/dev/null || "$venv/bin/pip" install -q "$package" >&2 ||
        say "*** $package CANNOT BE HAD, see above: what needs it is NOT TESTED"
    done
  fi
  say "$2"
  exit 0
}

missing=()
for package in "${packages[@]}" "${tools[@]}"; do
  installed "$package" || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  finish "${1:-}" "nothing to install: Rust $rust, ${packages[*]}${tools[*]:+ ${tools[*]}} are there"
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null ||
    fail "not root and no sudo; run as root: apt-get update && apt-get install ${missing[*]}"
  as_root=(sudo)
fi
apt_install() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" >&2
}

say "installing ${missing[*]} through apt-get${as_root:+ (with sudo)}"
# The package lists may be old or absent: fetch them only if it does not work without.
if ! apt_install; then
  say "again, with fresh package lists"
  "${as_root[@]}" apt-get update -q >&2 || fail "apt-get update; see its message above"
  apt_install || fail "apt-get install ${missing[*]}; see its message above"
fi
for package in "${missing[@]}"; do
  installed "$package" || fail "$package is still not installed"
done
finish "${1:-}" "done: installed ${missing[*]}"
