# `make` alone lists what there is. ARGS goes to the command: `make demo ARGS=--exit`.

ARGS ?=

.PHONY: help demo test bench tools

help: ## list these targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' Makefile

demo: tools ## simulate a lab, train, evaluate, serve; ARGS=--exit to end by itself
	cargo build --release
	@cargo run --release --quiet -- demo $(ARGS)

test: tools ## format, lints, all tests
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	cargo test

bench: tools ## milliseconds a frame, step by step
	cargo bench $(ARGS)

tools:
	@command -v cargo >/dev/null || { echo "cargo is not on the PATH: install Rust 1.90 or newer, see https://rustup.rs." >&2; exit 1; }
	@command -v cc >/dev/null || { echo "cc is not on the PATH: install a C compiler, such as the package gcc or clang." >&2; exit 1; }
