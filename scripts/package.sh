#!/bin/sh
# Packages of the command, into target/package:
#
#   scripts/package.sh deb     for the Debian that this runs on, with manual pages and completions; what it links to is
#                              found by dpkg-shlibdeps (Embree has another name in each Debian)
#   scripts/package.sh wheel   for `pip install`, without any C library
#
#   scripts/package.sh tools   cargo-deb, if it is missing
#
# PACKAGE_PROFILE=dev packs a build of another profile than release. What follows is handed to what builds: cargo, or
# maturin. cargo-deb and maturin are installed if missing, maturin into a virtual environment of its own.
set -eu
cd "$(dirname "$0")/.."
profile=${PACKAGE_PROFILE:-release}
out=target/package
mkdir -p "$out"

tools() {
    # A build for use once or twice: three times as fast as an optimised one.
    command -v cargo-deb >/dev/null || cargo install --locked --debug --version 3.8.0 cargo-deb
}

deb() {
    command -v dpkg-shlibdeps >/dev/null || { echo 'apt-get install dpkg-dev' >&2; exit 1; }
    tools
    cargo build --profile "$profile" --bin pathspace "$@"
    built=$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
    case $profile in
        dev) built=$built/debug ;;
        *) built=$built/$profile ;;
    esac
    # Pages and completions come from the binary's own definition of its flags.
    rm -rf "$out/man" "$out/completions"
    mkdir -p "$out/completions"
    "$built/pathspace" man "$out/man" >/dev/null
    for shell in bash zsh fish; do
        "$built/pathspace" completions "$shell" >"$out/completions/$shell"
    done
    # Packages of different Debians have different names and an order: 1~deb12 is older than 1~deb13.
    . /etc/os-release
    revision=1~${ID:-debian}${VERSION_ID:-}
    cargo deb --no-build --profile "$profile" --deb-revision "$revision" --output "$out/"
}

wheel() {
    if ! command -v maturin >/dev/null; then
        if [ ! -x "$out/venv/bin/maturin" ]; then
            python3 -m venv "$out/venv"
            "$out/venv/bin/pip" install -q 'maturin>=1.7,<2'
        fi
        PATH=$PWD/$out/venv/bin:$PATH
    fi
    maturin build --profile "$profile" --out "$out" "$@"
}

case ${1:-} in
    deb | wheel | tools) "$@" ;;
    *) echo 'scripts/package.sh deb|wheel|tools' >&2; exit 2 ;;
esac
