# From a fresh clone: `make reports`, `make test`. Each makes .venv, installs what it needs and runs.
PYTHON ?= python3
STUDY ?= quick
JOBS ?= 2
VENV := .venv
BIN := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt
SOURCES := *.py common scenes selectors backends reports workflow tests
# One thread a process: the studies and the tests run several processes at once.
THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: help setup dev reports dashboard test lint types pytest bench gpu quality size fuzz external wheels datasheet format clean clean-results

help:
	@echo "make reports     the study STUDY=quick: choose, train, score, report (results/STUDY/reports/index.html)"
	@echo "make dashboard   MLflow over the runs just made, on http://127.0.0.1:5000"
	@echo "make test        linters, type checks and tests"
	@echo "make bench       timings, as ratios measured side by side"
	@echo "make gpu         what needs a GPU, tried and recorded (10 minutes; GPU=--real for a capture too)"
	@echo "make quality     PSNR of the CPU backend by seconds, its defaults beside other settings (8 minutes)"
	@echo "make size        seconds to 25 dB by size of the pictures, memory by number of views (10 minutes)"
	@echo "make fuzz        100,000 damaged inputs for every reader (FUZZ='--inputs 1000 kitti' for a part of it)"
	@echo "make external    a trainer from PyPI, nerfstudio's, installed (4 GB), run on the CPU and checked"
	@echo "make wheels      the package and, apart from it, the rendered rooms; make datasheet describes them"
	@echo "make clean       removes what was installed and made, except results/; make clean-results removes those"

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "viewbench needs Python 3.11 or newer; name one with make PYTHON=..."; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing viewbench and what it needs into $(VENV) (a minute or two)"
	@$(PIP) -e '.[study]'
	@$(BIN)/viewbench --version
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	@$(PIP) -e '.[dev]'
	@$(PIP) --no-deps nerfstudio==1.1.5
	@$(BIN)/python -c 'import pytest, ruff, pyright, hypothesis'
	@touch $@

setup: $(VENV)/.installed
dev: $(VENV)/.installed-dev

reports: setup
	@$(THREADS) $(BIN)/snakemake -j$(JOBS) --config study=$(STUDY) -- reports
	@echo "Open results/$(notdir $(basename $(STUDY)))/reports/index.html"

dashboard: setup
	$(BIN)/mlflow server --backend-store-uri sqlite:///results/mlflow.db --host 127.0.0.1 --port 5000

test: dev lint types pytest

lint: dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/python -m tests.snakemake_lint

# What an editor with pyright shows of this clone, which may have any name, has no red and no yellow line.
types: dev
	$(BIN)/pyright --warnings --pythonpath $(BIN)/python

pytest: dev
	$(THREADS) $(BIN)/python -m pytest -n $(JOBS) $(PYTEST)

bench: dev
	$(THREADS) $(BIN)/python tests/bench/bench_selectors.py $(BENCH)
	$(THREADS) $(BIN)/python tests/bench/bench_splat.py $(BENCH)
	$(THREADS) $(BIN)/python tests/bench/bench_encoder.py $(BENCH)
	$(THREADS) $(BIN)/python tests/bench/bench_threads.py $(BENCH)

gpu:
	@if nvidia-smi -L > /dev/null 2>&1; then $(MAKE) dev && $(BIN)/python -m tests.gpu $(GPU); \
	else echo "No GPU is in reach (nvidia-smi names none), so nothing was tried: gsplat and instant-ngp are as unproven here as before."; fi

quality: dev
	$(THREADS) $(BIN)/python tests/bench/bench_quality.py $(BENCH)

size: dev
	$(THREADS) $(BIN)/python tests/bench/bench_size.py $(BENCH)

# Reproductions and a table in build/fuzz.
fuzz: dev
	$(THREADS) $(BIN)/python -m tests.fuzz $(FUZZ)

# A program that is not ours behind `command:`; its environment is kept in build/external.
external: dev
	$(THREADS) $(BIN)/python -m tests.external_trainer build/external

# The code without the three rendered rooms, and these in a wheel of their own: `pip install --find-links dist
# 'viewbench[rooms]'` takes both.
wheels: dev
	$(BIN)/python -m build --wheel --outdir dist .
	$(BIN)/python -m build --wheel --outdir dist scenes/rendered

# The tables and pictures of scenes/rendered/README.md.
datasheet: dev
	$(BIN)/viewbench datasheet room_human room_smooth bedroom_human bedroom_smooth office_human office_smooth \
		glass_human glass_smooth --out build/datasheet

format: dev
	$(BIN)/ruff check --fix
	$(BIN)/ruff format
	$(BIN)/snakefmt Snakefile workflow

clean:
	rm -rf $(VENV) build dist .snakemake .pytest_cache .ruff_cache .hypothesis *.egg-info scenes/rendered/build scenes/rendered/*.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
	@test ! -e results || echo "results/ is kept; make clean-results removes it"

clean-results:
	rm -rf results
