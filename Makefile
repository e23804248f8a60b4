# make demo: grasps for an example depth image.   make view: the same in the browser.   make test: every check.
# All make their own environment in .venv first; nothing is installed outside this folder.

SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# pip says much; of it, what is being looked up, fetched and installed shows the progress, line by line.
CONSTRAINTS ?= constraints.txt
PIP_INSTALL := $(BIN)/python -u -m pip install --disable-pip-version-check -c $(CONSTRAINTS)
PROGRESS := awk '/^ *(Collecting|Downloading)|^Building|^Installing|^Successfully installed/ { print substr($$0, 1, 100); fflush() }'

.PHONY: help
help:
	@sed -n '1,2s/^# //p' Makefile

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.10 or newer is needed: make PYTHON=..." if sys.version_info < (3, 10) else 0)'
	@echo "Making $(VENV) (a few minutes the first time)"
	@$(PYTHON) -m venv $(VENV)

# One stamp for each set of dependencies, so that the demo does not wait for the tools of the tests.
$(VENV)/.demo: $(BIN)/python pyproject.toml $(CONSTRAINTS)
	@$(PIP_INSTALL) -e . | $(PROGRESS)
	@touch $@

$(VENV)/.view: $(BIN)/python pyproject.toml $(CONSTRAINTS)
	@$(PIP_INSTALL) -e ".[sim,viewer]" | $(PROGRESS)
	@touch $@ $(VENV)/.demo

$(VENV)/.dev: $(BIN)/python pyproject.toml $(CONSTRAINTS)
	@$(PIP_INSTALL) -e ".[dev]" | $(PROGRESS)
	@$(PIP_INSTALL) --no-deps dexterity==0.0.15 | $(PROGRESS)
	@touch $@ $(VENV)/.demo $(VENV)/.view

.PHONY: demo
demo: $(VENV)/.demo
	@mkdir -p out
	$(BIN)/ffhnet grasp examples/data/spray_flask_2000005_depth.png --intrinsics 615 615 320 240 \
	  --out out/grasps.json --plot out/grasps.png
	@echo "Next: look at out/grasps.png, or make view"

.PHONY: view
view: $(VENV)/.view
	$(BIN)/ffhnet view

.PHONY: test
test: $(VENV)/.dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	OMP_NUM_THREADS=1 $(BIN)/pytest -n 2

.PHONY: coverage
coverage: $(VENV)/.dev
	OMP_NUM_THREADS=1 $(BIN)/pytest -n 2 --cov --cov-report=term

# Every version that the tests ran with. torch without its local label: a build for another device is as good.
.PHONY: lock
lock: $(VENV)/.dev
	$(BIN)/python -m pip freeze --exclude-editable | sed 's/^\(torch==[^+]*\)+.*/\1/' > .ci/lock.txt

.PHONY: examples
examples: $(VENV)/.demo
	$(BIN)/python examples/make_example_views.py
