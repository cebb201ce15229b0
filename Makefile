# Everything a newcomer needs: `make run`, `make test`. Needs Python 3.11, git, make and gcc.
PYTHON ?= python3
VENV := .venv
PEERS := .venv-peers
BIN := $(VENV)/bin
STAMP := $(VENV)/.synced
OUT ?= out
JOBS ?= 2
TEST_ARGS ?=

# The matrices are small: BLAS threads only add jitter.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: run test lint format types scenarios pictures bench peers lock setup clean
.DELETE_ON_ERROR:

run: setup
	$(BIN)/wbmpc run scenarios/reach.yaml --out $(OUT)

test: setup
	$(BIN)/pytest -n $(JOBS) $(TEST_ARGS)

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check

format: setup
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

types: setup
	$(BIN)/mypy

scenarios: setup
	$(BIN)/wbmpc run scenarios/*.yaml --counterfactuals --out $(OUT)

# docs/scenarios.md anew, pictures and all.
pictures: setup
	$(BIN)/wbmpc run scenarios/*.yaml --out $(OUT)
	$(BIN)/wbmpc plot $(patsubst scenarios/%.yaml,$(OUT)/%.rrd,$(wildcard scenarios/*.yaml)) --out docs/pictures
	$(BIN)/python docs/scenarios_page.py

# All benchmarks, peers included, into docs/benchmarks.md, docs/benchmarks_stage3.md and docs/profile.md, about half an
# hour on a machine with nothing else to do; one of the first file's: PARTS=tracker.
PARTS ?=
bench: setup peers
	$(BIN)/python -m benchmarks $(PARTS) --write docs
ifeq ($(PARTS),)
	$(BIN)/python -m benchmarks.stage3_env
	.venv-peers-stage3/bin/python -m benchmarks.stage3_peers
endif

setup: $(STAMP)

# uv resolves nothing here: it installs exactly the pinned, hashed list, then this project on top.
$(STAMP): requirements/dev.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "wbmpc needs Python 3.11 or newer: make PYTHON=python3.11")'
	@echo "setting up $(VENV) (once, a few minutes)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@test -x $(BIN)/uv || $(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	@VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/uv pip sync --require-hashes requirements/dev.txt
	@VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/uv pip install --no-deps --no-build-isolation -e .
	@$(BIN)/python -m wbmpc.warm_up
	@touch $@

# The peers of the benchmarks, in an environment of their own: TSID's Pinocchio is not ours.
peers: $(PEERS)/.synced

$(PEERS)/.synced: requirements/peers.txt $(STAMP)
	@echo "setting up $(PEERS) (once)"
	@test -x $(PEERS)/bin/python || $(BIN)/uv venv --quiet --python $(BIN)/python $(PEERS)
	@VIRTUAL_ENV=$(CURDIR)/$(PEERS) $(BIN)/uv pip sync --quiet --require-hashes --only-binary :all: requirements/peers.txt
	@touch $@

UV_LOCK = $(BIN)/uv pip compile --quiet $(UPGRADE) --generate-hashes --no-emit-index-url \
	--python-version 3.11 --custom-compile-command "make lock"

# Keeps the pinned versions that still fit; `make lock UPGRADE=--upgrade` takes the newest.
lock: setup
	$(UV_LOCK) pyproject.toml --output-file requirements/run.txt
	$(UV_LOCK) pyproject.toml --group dev --output-file requirements/dev.txt
	$(UV_LOCK) requirements/peers.in --output-file requirements/peers.txt

clean:
	rm -rf $(OUT) $(VENV) $(PEERS) .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
