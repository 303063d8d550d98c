# One command each, complete by itself: sets up what is missing, builds, runs. `make help` lists them.

.DEFAULT_GOAL := help
.PHONY: help render bench test test-nolib lint setup setup-nolib setup-lint

# Passed on to `cargo test`: `make test TESTS=backend::embree` runs those alone.
TESTS ?=
BENCH ?=
SCENE := scenes/cornell-box/scene.gltf
NOLIB := -p pathspace -p pathspace-stat --no-default-features

help:
	@echo 'make render       set up, build, render the Cornell box to cornell-box.exr and .png'
	@echo 'make test         set up, build, run the whole test suite'
	@echo 'make test-nolib   the same without any C or C++ library'
	@echo 'make bench        set up, build, run the benches (Embree and obvhs; about a minute once built)'
	@echo 'make lint         set up, rustfmt, clippy and rustdoc with warnings as errors'
	@echo 'make setup        install what building needs (Debian 12, 13);'
	@echo '                  setup-nolib: without Embree; setup-lint: rustfmt and clippy as well'

setup:
	@scripts/setup.sh

setup-nolib:
	@scripts/setup.sh nolib

setup-lint:
	@scripts/setup.sh lint

render: setup
	cargo build --release
	target/release/pathspace render $(SCENE) -o cornell-box.exr --png cornell-box.png --width 512 --height 512 --spp 256
	@echo 'The image:   $(CURDIR)/cornell-box.exr'
	@echo 'Its preview: $(CURDIR)/cornell-box.png'

# `make bench BENCH=trace/spheres` runs those alone.
bench: setup
	cargo bench --bench bvh_build --bench trace --bench shade --bench texture --bench frame -- $(BENCH)

test: setup
	cargo test --workspace $(TESTS)

test-nolib: setup-nolib
	cargo test $(NOLIB) $(TESTS)

lint: setup-lint
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets -- -D warnings
	cargo clippy $(NOLIB) --all-targets -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --lib
