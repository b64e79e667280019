# `make demo` and `make test` set everything up in a fresh clone.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
BENCH_VENV ?= .venv-bench
PEERS = sed -n '/^peers = /,/^]/s/^ *"\(.*\)",/\1/p' pyproject.toml

.PHONY: help setup demo bench test test-slow lint check dist site format clean

help:  ## Say what can be made.
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[catsim,dev]'
	touch $(READY)

$(BENCH_VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(BENCH_VENV)
	$(BENCH_VENV)/bin/pip install --quiet --upgrade pip
	$(BENCH_VENV)/bin/pip install --quiet --constraint constraints.txt --editable .
	for peer in $$($(PEERS)); do \
	  $(BENCH_VENV)/bin/pip install --quiet --constraint constraints.txt "$$peer" || echo "$$peer cannot be installed here"; \
	done
	touch $(BENCH_VENV)/.ready

# Threads that spin while they wait take the processor from the kernels' own.
export OMP_WAIT_POLICY ?= PASSIVE

setup: $(READY)  ## Make the virtual environment.

demo: $(READY)  ## Simulate a low-dose slice, reconstruct it in several ways, write numbers and a picture.
	PATH="$(abspath $(BIN)):$$PATH" bash runs/demo.sh demo

bench: $(BENCH_VENV)/.ready  ## Time pnpct against its peers on this quiet machine; figures in bench/. BENCH has options.
	$(BENCH_VENV)/bin/python benchmarks/bench.py bench $(BENCH)

test: $(READY)  ## Run the tests, README and docs included.
	$(BIN)/pytest -q -n auto --dist loadfile -m "not slow"

test-slow: $(READY)  ## Run all tests, the slow ones and the examples of the docstrings too.
	$(BIN)/pytest -q
	$(BIN)/pytest -q --doctest-modules src

lint: $(READY)  ## Format, lint, types and import contracts.
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports

check: lint test  ## What must be green at each commit.

dist: $(READY)  ## Build the wheel and the source, check them, and go the walks of users with the wheel in a new environment.
	rm -rf dist
	$(BIN)/python -m build --quiet
	$(BIN)/twine check --strict dist/*
	FRESH=$$(mktemp -d) && trap 'rm -rf "$$FRESH"' EXIT && $(PYTHON) -m venv "$$FRESH/venv" \
	  && "$$FRESH/venv/bin/pip" install --quiet --constraint constraints.txt dist/*.whl \
	  && export NUMBA_CACHE_DIR="$$FRESH/numba" && (cd "$$FRESH" && venv/bin/pnpct demo --quick) \
	  && "$$FRESH/venv/bin/python" tests/walks/walk.py tests/walks/*.txt

site: $(READY)  ## Build the documentation as a site in site/; a warning is an error.
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[site]'
	NO_MKDOCS_2_WARNING=1 PATH="$(abspath $(BIN)):$$PATH" $(BIN)/mkdocs build --strict

format: $(READY)  ## Let ruff format and mend what it can.
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

clean:  ## Remove the virtual environments, and what the bench, demo, dist and site wrote.
	rm -rf $(VENV) $(BENCH_VENV) bench demo dist site
