# One command each, complete by itself: sets up what is missing, builds, runs. `make help` lists them.

.DEFAULT_GOAL := help
.PHONY: help render bench gates prices robustness scaling test hard golden gallery fuzz soak test-nolib lint
.PHONY: memcheck
.PHONY: test-browser deb wheel farm setup setup-nolib setup-lint setup-gates setup-fuzz setup-browser setup-farm

# Passed on to `cargo test`: `make test TESTS=backend::embree` runs those alone.
TESTS ?=
BENCH ?=
SCENE := scenes/cornell-box/scene.gltf
# Without any C or C++ library, and the bare library without the command line.
NOLIB := -p pathspace -p pathspace-stat --no-default-features --features pathspace/cli
BARE := -p pathspace --no-default-features --lib

help:
	@echo 'make render       set up, build, render the Cornell box to cornell-box.exr and .png'
	@echo 'make test         set up, build, run the whole test suite'
	@echo 'make hard         set up, build, run the hard numerical cases; prints their table, writes tests/HARD.md'
	@echo 'make golden       set up, build, write tests/golden anew (needs ../shared/assets; a commit of its own)'
	@echo 'make gallery      set up, build, render every model of ../shared/assets/khronos beside its screenshot:'
	@echo '                  target/gallery/index.html (some minutes; NAMES="Fox Cameras": those anew)'
	@echo 'make test-nolib   the same without any C or C++ library'
	@echo 'make test-browser set up, build, lead the pages in Chromium: mouse, sliders, what is saved'
	@echo 'make bench        set up, build, run the benches (Embree and obvhs; about a minute once built)'
	@echo 'make gates        set up, build, count what each effect costs and that what is not called for is free'
	@echo 'make prices       set up, build, write benches/PRICES.md: instructions and samples to 2 % on every scene'
	@echo 'make robustness   set up, build, print what each robust choice costs and what breaks without it (a minute)'
	@echo 'make scaling      set up, build, print how cost grows with triangles and samples, with exponents'
	@echo '                  (two minutes once built)'
	@echo 'make fuzz         set up, build, feed mutated scenes, then images, to the loader for a minute each'
	@echo '                  (FUZZ_SECONDS=600: ten); what breaks it lies in fuzz/target/findings,'
	@echo '                  scripts/fuzz.sh FILE replays it (images FILE)'
	@echo 'make memcheck     set up, build, run the unit tests of what calls C and C++ under valgrind'
	@echo 'make soak         set up, build, render under random faults for an hour (SOAK_SECONDS=600: ten minutes):'
	@echo '                  signals, limits, inputs that change, full disks; scripts/soak.py SEED replays a finding'
	@echo '                  (scripts/soak.py kills 200: one render, killed that often)'
	@echo 'make farm         set up, build, run jobs of pathspace farm by Slurm and OpenJD on this machine'
	@echo 'make lint         set up, rustfmt, clippy and rustdoc with warnings as errors'
	@echo 'make deb          set up, build, pack target/package/*.deb for this Debian, manual pages and completions in it'
	@echo 'make wheel        set up, build, pack target/package/*.whl for pip, without any C or C++ library'
	@echo 'make setup        install what building needs (Debian 12, 13);'
	@echo '                  setup-nolib: without Embree and OpenImageIO; setup-lint: rustfmt and clippy;'
	@echo '                  setup-gates: valgrind; setup-fuzz: C++ and OpenImageIO; setup-browser: Chromium;'
	@echo '                  setup-farm: Slurm, openjd-cli'

setup:
	@scripts/setup.sh

setup-nolib:
	@scripts/setup.sh nolib

setup-lint:
	@scripts/setup.sh lint

setup-gates:
	@scripts/setup.sh gates

setup-fuzz:
	@scripts/setup.sh fuzz

setup-browser:
	@scripts/setup.sh browser

setup-farm:
	@scripts/setup.sh farm

render: setup
	cargo run --release -- render $(SCENE) -o cornell-box.exr --png cornell-box.png --width 512 --height 512 --spp 256
	@echo 'The image:   $(CURDIR)/cornell-box.exr'
	@echo 'Its preview: $(CURDIR)/cornell-box.png'

# `make bench BENCH=trace/spheres` runs those alone.
bench: setup
	cargo bench --bench bvh_build --bench trace --bench shade --bench texture --bench frame -- $(BENCH)

# `make gates FILTER=lens` measures one row; `make gates BASELINE=write` records the base scene's cost anew.
# Without the command and the C libraries, which the counted scenes do not use, half as much is built.
gates: setup-gates
	cargo bench --no-default-features --bench gates

# What 2 % costs on every scene, in instructions and samples: some minutes once built.
prices: setup setup-gates
	cargo build --release
	scripts/prices.py "$$(cargo metadata --format-version 1 --no-deps | \
		sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release/pathspace" -o benches/PRICES.md

# What each choice for robustness costs, and what breaks without it.
robustness: setup
	cargo bench --bench robustness

# How cost grows with triangles and with samples.
scaling: setup
	cargo bench --bench scaling

test: setup
	cargo test --workspace $(TESTS)

# One at a time: each has a browser of its own.
test-browser: setup-browser
	cargo test --workspace --test suite browser:: -- --ignored --test-threads 1

# Every case is run even if one fails; the table shows which.
HARD := $(CURDIR)/target/hard
hard: setup
	rm -rf $(HARD)
	mkdir -p $(HARD)
	status=0; PATHSPACE_HARD=$(HARD) cargo test --no-fail-fast --test suite hard:: || status=$$?; \
	PATHSPACE_HARD=$(HARD) cargo test --quiet --test suite hard::table::print -- --ignored --nocapture && \
	cp $(HARD)/HARD.md tests/HARD.md && exit $$status

golden: setup
	cargo test --test suite -- --ignored asset::write models::write

NAMES ?=
gallery: setup
	cargo build --release
	PATHSPACE="$$(cargo metadata --format-version 1 --no-deps | \
		sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release/pathspace" \
		scripts/gallery.py ../shared/assets/khronos target/gallery $(NAMES)

FUZZ_SECONDS ?= 60
fuzz: setup-fuzz
	scripts/fuzz.sh gltf $(FUZZ_SECONDS)
	scripts/fuzz.sh images $(FUZZ_SECONDS)

# The tests are those of `make test`.
memcheck: setup-gates
	scripts/memcheck.sh

# Not in CI: what it finds depends on the moment. scripts/soak.py says what is done and what has to hold.
soak: setup
	cargo build --release
	PATHSPACE="$${PATHSPACE:-$$(cargo metadata --format-version 1 --no-deps | \
		sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release/pathspace}" scripts/soak.py

# What it compares with is rendered by the same binary; the part `farm` of .ci/run does it with the tests' one.
farm: setup setup-farm
	cargo build --release
	scripts/check-farm.sh "$$(cargo metadata --format-version 1 --no-deps | \
		sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release/pathspace"

deb: setup
	scripts/package.sh deb

wheel: setup-nolib
	scripts/package.sh wheel

test-nolib: setup-nolib
	cargo test $(NOLIB) $(TESTS)

lint: setup-lint
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets -- -D warnings
	cargo clippy $(NOLIB) --all-targets -- -D warnings
	cargo clippy $(BARE) -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --lib
