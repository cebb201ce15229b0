# Everything a newcomer needs: `make run`, `make test`. Needs Python 3.11, git, make and gcc.
PYTHON ?= python3
VENV := .venv
PEERS := .venv-peers
DOCS := .venv-docs
BIN := $(VENV)/bin
STAMP := $(VENV)/.synced
OUT ?= out
JOBS ?= 2
TEST_ARGS ?=

# The matrices are small: BLAS threads only add jitter.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: run test lint format types scenarios pictures viewer interact-picture report report-pictures reference docs docs-serve bench peers lock setup clean
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
	$(BIN)/wbmpc run scenarios/*.yaml --counterfactuals --golden scenarios/golden --out $(OUT)

# docs/scenarios.md anew, pictures and all.
pictures: setup
	$(BIN)/wbmpc run scenarios/*.yaml --out $(OUT)
	$(BIN)/wbmpc plot $(patsubst scenarios/%.yaml,$(OUT)/%.rrd,$(wildcard scenarios/*.yaml)) --out docs/pictures
	$(BIN)/python docs/scenarios_page.py

# The viewer's pictures in docs/recordings.md and docs/explain.md, by the commands that they show; needs Vulkan
# (mesa-vulkan-drivers and libvulkan1).
viewer: setup
	$(BIN)/wbmpc run scenarios/reach.yaml scenarios/hole.yaml --out out
	$(BIN)/wbmpc branch out/reach.rrd --at 2.3 --set forbid=table_right_1
	grep -h '^wbmpc screenshot' docs/recordings.md docs/explain.md | sed 's|^|$(BIN)/|' | sh -e

# The picture of docs/live.md: MuJoCo's window on a virtual display; needs Xvfb.
interact-picture: setup
	$(BIN)/python docs/interact_picture.py

# One page about everything in $(OUT).
report: setup
	$(BIN)/wbmpc report $(OUT)

# The pictures of docs/report.md: a page in a real browser, light and dark; needs Chromium.
report-pictures: setup
	$(BIN)/wbmpc run scenarios/reach.yaml --counterfactuals --out $(OUT)/report
	$(BIN)/wbmpc report $(OUT)/report --title "Reaching over a table"
	$(BIN)/python docs/report_pictures.py $(OUT)/report/report.html

# docs/reference/ anew, after a change of the schema, a check or the command line.
reference: setup
	$(BIN)/python -m docs.tools.reference

# The documentation site into site/: any warning, dead link or page without a place in the navigation is an error.
docs: $(DOCS)/.synced
	$(DOCS)/bin/python -m docs.tools.build

# The same at localhost:8000, rendered anew when a page changes.
docs-serve: $(DOCS)/.synced
	$(DOCS)/bin/python -m docs.tools.build --serve

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

# The renderer in an environment of its own, so that its packages are no concern of the simulator's: it reads the
# sources and imports nothing of them.
$(DOCS)/.synced: requirements/docs.txt $(STAMP)
	@echo "setting up $(DOCS) (once)"
	@test -x $(DOCS)/bin/python || $(BIN)/uv venv --quiet --python $(BIN)/python $(DOCS)
	@VIRTUAL_ENV=$(CURDIR)/$(DOCS) $(BIN)/uv pip sync --quiet --require-hashes requirements/docs.txt
	@touch $@

UV_LOCK = $(BIN)/uv pip compile --quiet $(UPGRADE) --generate-hashes --no-emit-index-url \
	--python-version 3.11 --custom-compile-command "make lock"

# Keeps the pinned versions that still fit; `make lock UPGRADE=--upgrade` takes the newest.
lock: setup
	$(UV_LOCK) pyproject.toml --output-file requirements/run.txt
	$(UV_LOCK) pyproject.toml --group dev --output-file requirements/dev.txt
	$(UV_LOCK) --group docs --output-file requirements/docs.txt
	$(UV_LOCK) requirements/peers.in --output-file requirements/peers.txt

clean:
	rm -rf $(OUT) $(VENV) $(PEERS) $(DOCS) site build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
