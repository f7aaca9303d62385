# From a fresh clone: `make reports`, `make test`. Each makes .venv, installs what it needs and runs.
PYTHON ?= python3
STUDY ?= quick
JOBS ?= 2
PORT ?= 5000
VENV := .venv
BIN := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt
SOURCES := *.py common scenes selectors backends reports workflow tests
# One thread a process: the studies and the tests run several processes at once.
THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: help setup dev reports dashboard test packages lint types pytest bench gpu quality size memory external wheels lock audit versions datasheet format clean clean-results test-server test-slurm soak hostile fuzz screenshots

help:
	@echo "make reports     the study STUDY=quick: choose, train, score, report (results/STUDY/reports/index.html)"
	@echo "make dashboard   MLflow over the runs just made, on http://127.0.0.1:5000 (PORT=)"
	@echo "make screenshots what people see in MLflow of the runs just made: pictures in build/screenshots (needs Chromium)"
	@echo "make test        linters, type checks and tests"
	@echo "make soak        a study that is killed 60 times at random moments (half an hour; SOAK='--kills N --seed S')"
	@echo "make bench       timings, as ratios measured side by side"
	@echo "make gpu         what needs a GPU, tried and recorded (10 minutes; GPU=--real for a capture too)"
	@echo "make quality     PSNR of the CPU backend by seconds, its defaults beside other settings (8 minutes)"
	@echo "make size        seconds to 25 dB by size of the pictures, memory by number of views (10 minutes)"
	@echo "make memory      peak memory of choosing, training and scoring by number of frames, up to 3,000 (10 minutes)"
	@echo "make hostile     captures that mean harm: what each costs in seconds and memory (3 minutes)"
	@echo "make fuzz        100,000 damaged inputs for every reader (FUZZ='--inputs 1000 kitti' for a part of it)"
	@echo "make external    a trainer from PyPI, nerfstudio's, installed (4 GB), run on the CPU and checked"
	@echo "make test-server a study logged to MLflow's server over PostgreSQL while both are killed (10 minutes; INSTALL=1: apt-get)"
	@echo "make test-slurm  a study on a cluster of Slurm's, made and harmed here (root; INSTALL=1 installs Slurm; 20 minutes)"
	@echo "make wheels      the package and, apart from it, the rendered rooms; make datasheet describes them"
	@echo "make lock        requirements.lock and requirements-select.lock, after a change of what is needed"
	@echo "make audit       known vulnerabilities of what the lock files name (asks PyPI; or ADVISORIES=FOLDER)"
	@echo "make versions    Python 3.11 to 3.13, each with the least, the pinned and the newest packages (an hour or two)"
	@echo "make clean       removes what was installed and made, except results/; make clean-results removes those"

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "viewbench needs Python 3.11 or newer; name one with make PYTHON=..."; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing viewbench and what it needs into $(VENV) (a minute or two)"
	@$(PIP) -e '.[study]'
	@$(BIN)/viewbench --version
	@touch $@

# nerfstudio's code is read by tests alone, without most of what it needs, which would break `pip check`: it has a
# folder of its own (tests/nerfstudio_code.py).
$(VENV)/.installed-dev: $(VENV)/.installed
	@$(PIP) -e '.[dev]'
	@$(BIN)/python -m pip uninstall -qq -y nerfstudio 2> /dev/null
	@$(PIP) --no-deps --upgrade --target $(VENV)/nerfstudio nerfstudio==1.1.5
	@$(BIN)/python -c 'import pytest, ruff, pyright, hypothesis'
	@touch $@

setup: $(VENV)/.installed
dev: $(VENV)/.installed-dev

reports: setup
	@$(THREADS) $(BIN)/snakemake -j$(JOBS) --config study=$(STUDY) -- reports
	@echo "Open results/$(notdir $(basename $(STUDY)))/reports/index.html"

dashboard: setup
	@$(BIN)/viewbench dashboard --port $(PORT)

# STORE= may also be the address of a server that runs; SHOTS='--readme reports/mlflow.png' makes the README's picture.
STORE ?= results/mlflow.db
screenshots: dev
	$(BIN)/python -m tests.screenshots $(STORE) build/screenshots $(SHOTS)

test: dev packages lint types pytest

# Every installed package has what it needs, in a version that it takes.
packages: dev
	$(BIN)/python -m pip check

lint: dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/python -m tests.snakemake_lint
	$(BIN)/hadolint workflow/container/Containerfile

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

hostile: dev
	$(THREADS) $(BIN)/python tests/scenes/hostile.py

gpu:
	@if nvidia-smi -L > /dev/null 2>&1; then $(MAKE) dev && $(BIN)/python -m tests.gpu $(GPU); \
	else echo "No GPU is in reach (nvidia-smi names none), so nothing was tried: gsplat and instant-ngp are as unproven here as before."; fi

# A small study, killed at random 60 times and more, ends as one that was left alone (half an hour).
soak: dev
	$(THREADS) $(BIN)/python -m tests.soak $(SOAK)

quality: dev
	$(THREADS) $(BIN)/python tests/bench/bench_quality.py $(BENCH)

size: dev
	$(THREADS) $(BIN)/python tests/bench/bench_size.py $(BENCH)

memory: dev
	$(THREADS) $(BIN)/python tests/bench/bench_memory.py $(BENCH)

# Reproductions and a table in build/fuzz.
fuzz: dev
	$(THREADS) $(BIN)/python -m tests.fuzz $(FUZZ)

# A program that is not ours behind `command:`; its environment is kept in build/external.
external: dev
	$(THREADS) $(BIN)/python -m tests.external_trainer build/external

# MLflow's server over PostgreSQL, both restarted and killed under eight writers; packages are kept in build/server.
test-server: dev
	$(THREADS) $(BIN)/python -m tests.server build/server $(if $(INSTALL),--install) $(SERVER)

# workflow/profiles/slurm tried for real, on a cluster of two nodes that lives as long as the test.
test-slurm: dev
	$(THREADS) $(BIN)/python -m tests.slurm $(if $(INSTALL),--install) $(SLURM)

# The code without the three rendered rooms, and these in a wheel of their own: `pip install --find-links dist
# 'viewbench[rooms]'` takes both.
wheels: dev
	$(BIN)/python -m build --wheel --outdir dist .
	$(BIN)/python -m build --wheel --outdir dist scenes/rendered

# Programs for those who change the dependencies, apart from what viewbench itself is tested with.
build/tools/.installed:
	@$(PYTHON) -m venv build/tools
	@build/tools/bin/python -m pip install -qq --disable-pip-version-check uv==0.13.9 pip-audit==2.10.1
	@touch $@

# The lock files, after a change of pyproject.toml or constraints.txt.
lock: dev build/tools/.installed
	$(BIN)/python -m tests.lock build/tools/bin/uv

versions: dev build/tools/.installed
	$(BIN)/python -m tests.versions --uv build/tools/bin/uv $(VERSIONS)

# Known vulnerabilities of what the lock files name: pip-audit asks a service, or ADVISORIES= names a clone of
# pypa/advisory-database.
audit: dev build/tools/.installed
	$(BIN)/python -m tests.audit --pip-audit build/tools/bin/pip-audit $(if $(ADVISORIES),--advisories $(ADVISORIES))

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
