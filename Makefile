# orbits: everything from a fresh clone needs only make, python3 >= 3.11 with venv, and the Python package index.
#
#     make run  make test  make nightly  make contracts  make faults  make slow  make bench  make docs  make clean  make help
#
# PYTHON=python3.12 chooses another interpreter for .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
MINIMUM := 3, 11

# Stamps. Each is newer than pyproject.toml when all that it asks for is installed.
MADE := $(VENV)/.made
BASE := $(VENV)/.installed
DEV := $(VENV)/.installed-dev
BENCH := $(VENV)/.installed-bench
DOCS := $(VENV)/.installed-docs

# The suite on all cores, up to four: a worker takes 2 GB. What many tests need is compiled before; then each worker begins
# with a part of its own, so that few kernels are compiled twice, and takes over from another when it is done. A test that hangs is named, with all stacks, and the
# others go on.
WORKERS := --numprocesses auto --maxprocesses 4 --dist worksteal --timeout 1200 --timeout-method thread

.DEFAULT_GOAL := help
.PHONY: run test nightly contracts faults bench slow docs clean help

run: $(BASE)  ## set up .venv and run the asteroid belt with its comparison against REBOUND
	$(BIN)/orbits warm-up asteroid_belt
	$(BIN)/orbits run asteroid_belt

test: $(DEV)  ## set up .venv and run every check: ruff, mypy, import-linter, pytest
	$(BIN)/python -m ruff check .
	$(BIN)/python -m mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.compiled_first
	$(BIN)/python -m pytest $(WORKERS) -rfEs --disable-warnings

nightly: $(DEV)  ## every test there is: whole products, many examples, slow ones, contracts, faults
	$(BIN)/python -m tests.compiled_first
	$(BIN)/python -m pytest $(WORKERS) -m "" --hypothesis-profile nightly -rfEs --disable-warnings

slow: $(DEV)  ## the tests that take minutes
	$(BIN)/python -m pytest -m slow

contracts: $(DEV)  ## every method on every Lagrangian: what is declared holds, what is not fails
	$(BIN)/python -m pytest tests/contracts -m "not slow"

faults: $(DEV)  ## attack runs and archives: kills, races, full disks, damaged and hostile files, signals, a fuzz
	$(BIN)/python -m pytest tests/faults -m "not slow"

bench: $(BENCH)  ## measure speed and accuracy against the peers
	$(BIN)/python scripts/benchmark.py

docs: $(DOCS)  ## build the site of the documentation, without a network; warnings are errors
	$(BIN)/python -m sphinx -q -E -W --keep-going docs build/docs
	@echo "The site is at file://$(CURDIR)/build/docs/index.html"

clean:  ## remove .venv, caches and builds; results/ stays
	rm -rf $(VENV) build dist docs/_generated .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -not -path './.git/*' -prune -exec rm -rf {} +

help:  ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' Makefile

$(BASE): pyproject.toml | $(MADE)
	$(PIP) install --editable .
	@touch $@

$(DEV): pyproject.toml | $(MADE)
	$(PIP) install --editable ".[dev]"
	@touch $@ $(BASE)

$(BENCH): pyproject.toml | $(MADE)
	$(PIP) install --editable ".[bench]"
	@touch $@ $(BASE)

$(DOCS): pyproject.toml | $(MADE)
	$(PIP) install --editable ".[docs]"
	@touch $@ $(BASE)

# The stamp, not the folder, says that .venv is whole: one interrupted half-way is completed by the next make.
$(MADE):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < ($(MINIMUM)))' 2>/dev/null || { \
	  echo "orbits needs Python >= 3.11, but '$(PYTHON)' is $$($(PYTHON) --version 2>&1 | head -n 1)."; \
	  echo "Name a newer one, for example: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; } >&2
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { \
	  echo "'$(PYTHON)' comes without venv or pip. On Debian and Ubuntu: apt install python3-venv"; exit 1; } >&2
	$(PYTHON) -m venv $(VENV)
	@touch $@
