# `make` alone lists what there is. ARGS goes to the command: `make demo ARGS=--exit`.

ARGS ?=

# What users may leave out is tested too.
FEATURES := --all-features

PYTHON ?= python3
# An S3 server, which the tests of models in buckets start.
MOTO := 'moto[s3]' flask flask-cors
# What the matrix of pictures is made with.
PILLOW := Pillow numpy
PICTURES := target/pictures
# Made once; the stamp is renewed where what is installed changes.
VENV := target/python
STAMP := $(VENV)/.installed

.PHONY: help demo test bench tools test-python

help: ## list these targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' Makefile

demo: tools ## simulate a lab, train, evaluate, serve; ARGS=--exit to end by itself
	cargo build --release
	@cargo run --release --quiet -- demo $(ARGS)

test: tools ## format, lints, all tests
	cargo fmt --check
	cargo clippy --all-targets $(FEATURES) -- -D warnings
	cargo test $(FEATURES)
	@$(MAKE) --no-print-directory test-python

test-python: tools
	@if $(PYTHON) -c 'import venv, ensurepip' 2>/dev/null && $(MAKE) --no-print-directory $(STAMP); then \
	  cargo build --tests $(FEATURES) && PYTHONPATH=clients/python/src $(VENV)/bin/python -m unittest discover clients/python/tests && \
	  cargo test $(FEATURES) --lib repository::bucket && \
	  $(VENV)/bin/python tests/pictures/matrix.py $(PICTURES) && \
	  ROOMSIGHT_PICTURES=$(PICTURES) cargo test $(FEATURES) --test pictures; \
	else \
	  echo "LEFT OUT: the tests of the Python client, of Triton's, of buckets and of pictures beside Pillow's. They take python3 with venv, and its packages from an index." >&2; \
	fi

$(STAMP): clients/python/pyproject.toml Makefile
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --retries 1 './clients/python[test]' $(MOTO) $(PILLOW)
	@touch $(STAMP)

bench: tools ## milliseconds a frame, step by step
	cargo bench $(ARGS)

tools:
	@command -v cargo >/dev/null || { echo "cargo is not on the PATH: install Rust 1.90 or newer, see https://rustup.rs." >&2; exit 1; }
	@command -v cc >/dev/null || { echo "cc is not on the PATH: install a C compiler, such as the package gcc or clang." >&2; exit 1; }
