# make demo   the whole monitor on a film that comes with it; installs the runtime only
# make test   lint, types, layer contracts and tests: the same examples on every machine
# make test-live   the tests that need servers or take long, which make test leaves out
# make soak   what takes hours: a live site under load, 200 kills, hundreds of reconnects, four streams for HOURS=2
# make test-processors   the numeric tests as older processors would compute; TESTS=... for others
# make licences   of all that a runtime install brings, against an allow list; writes dist/standoff.cdx.json (CycloneDX)
# make bundle   a folder in dist/ that installs without a network: wheels for this platform, detector, docs; EXTRAS=scale for more
# make page   the pages of `standoff setup`, `open` and `serve`, built with Node; before `pip install .`, or in place for an editable one
# make docs   the documentation as a site in site/; a dead link fails
# make coverage   how much of the packages that run on site their own tests reach
# make fuzz   the laws with many more examples, and others each time; prints how to repeat a failure
# All set themselves up on a fresh Debian or Ubuntu with python3 and make.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
SHARED ?= ../shared/data
YOLO := $(SHARED)/weights/yolo-fastest-1.1-xl/yolo-fastest-1.1-xl
WORKERS ?= 2
ALL_TESTS := tests simulator/tests
# The packages that run on site, and the tests that are theirs.
COUNTED := tests/core tests/files tests/stages tests/monitor src/standoff/core src/standoff/files src/standoff/stages src/standoff/monitor

DEMO_VENV := .venv-demo
SOURCES := $(shell find src -type f -not -path '*/__pycache__/*')

.PHONY: help setup test test-live soak test-processors coverage fuzz lint types contracts licences bundle unit compiled demo demo-clean demo-pets docs page bench lock clean

help:
	@sed -n 's/^# make/make/p' Makefile

# An empty virtual environment in $(1); with the venv module from apt where Python comes without.
define empty_venv
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "standoff needs Python 3.11 or newer; found $$($(PYTHON) --version). Set PYTHON=/path/to/python3.11."; exit 2; }
	@test -x $(1)/bin/python && $(1)/bin/python -m pip --version >/dev/null 2>&1 || \
	  $(PYTHON) -m venv --clear $(1) || $(MAKE) --no-print-directory venv-by-apt VENV=$(1)
	$(1)/bin/python -m pip install --quiet --upgrade pip
endef

setup: $(READY)

# The lock fixes every version; the test oracles come without their dependencies, because those would
# bring a second OpenCV that overwrites the headless one.
$(READY): pyproject.toml simulator/pyproject.toml requirements.lock requirements-oracles.txt
	$(call empty_venv,$(VENV))
	$(BIN)/python -m pip install --quiet --constraint requirements.lock --editable '.[dev,scale,serve,train]' --editable ./simulator
	$(BIN)/python -m pip install --quiet --no-deps --requirement requirements-oracles.txt
	@touch $@

.PHONY: venv-by-apt
venv-by-apt:
	@sudo=$$([ "$$(id -u)" = 0 ] || echo sudo -n); command -v apt-get >/dev/null || \
	  { echo "python3 has no venv module: install it (python3-venv) and run make again."; exit 2; }; \
	$$sudo apt-get update -qq && $$sudo apt-get install -y -qq python3-venv && $(PYTHON) -m venv --clear $(VENV)

# Side by side what needs one core only: first of all what takes longest.
test: $(READY)
	@$(MAKE) --no-print-directory --jobs=2 types compiled contracts lint licences
	@$(MAKE) --no-print-directory unit

# Both workers would each compile all loops of a fresh clone.
compiled: $(READY)
	OMP_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python tests/compile_loops.py

# pytest leaves with 5 where nothing is marked, and only then is that no failure.
test-live: $(READY)
	@code=0; OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest $(ALL_TESTS) -n $(WORKERS) --dist worksteal -m live || code=$$?; \
	if [ $$code = 5 ]; then echo "No test is marked live."; else exit $$code; fi

# One after another: they measure.
soak: $(READY)
	SOAK_KILLS=200 SOAK_HOURS=$(or $(HOURS),2) $(BIN)/python -m pytest tests/service/live -s -m "soak or live" \
	  -k "soak or killed" -p no:xdist
	SOAK_FUZZED=$(or $(FUZZED),100000) $(BIN)/python -m pytest tests/messages/test_fuzzed_messages.py tests/test_fuzzed_site.py \
	  -k "damaged and 0"

test-processors: $(READY)
	$(BIN)/python tests/other_processors.py $(TESTS)

fuzz: $(READY)
	$(BIN)/python -m pytest $(or $(TESTS),$(ALL_TESTS)) -n $(WORKERS) -m "hypothesis and not live" --hypothesis-profile=fuzz

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

contracts: $(READY)
	$(BIN)/lint-imports

# Of all that a runtime install brings; shipping/licences.yaml says which are allowed, and why some are all the same.
licences: $(READY)
	$(BIN)/python shipping/licences.py --out dist/standoff.cdx.json

# One thread a worker: two workers with two threads each get in each other's way, and sums depend on their number.
unit: $(READY)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

# Apart from make test: to trace makes Python half as slow again, in the libraries too.
coverage: $(READY)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(COUNTED) \
	  --cov --cov-report=term --cov-fail-under=95

bench: $(READY)
	$(BIN)/python -m pytest benchmarks -p no:xdist --benchmark-only --benchmark-columns=median,iqr,rounds

# The simulator is in it; what trains is not.
bundle: $(READY)
	$(BIN)/python shipping/bundle.py --extras "$(EXTRAS)"

# Node 18 or newer; from apt where there is none.
page:
	@command -v npm >/dev/null || { sudo=$$([ "$$(id -u)" = 0 ] || echo sudo -n); \
	  $$sudo apt-get update -qq && $$sudo apt-get install -y -qq nodejs npm; }
	cd page && npm ci --silent --no-audit --no-fund && npm run --silent check && npm run --silent build

docs: $(READY)
	$(BIN)/mkdocs build --strict

# The runtime only, as `pip install standoff` gives it: no torch, no OpenGL, nothing of the tests.
$(DEMO_VENV)/.ready: pyproject.toml requirements.lock $(SOURCES)
	$(call empty_venv,$(DEMO_VENV))
	$(DEMO_VENV)/bin/python -m pip install --quiet --constraint requirements.lock .
	@touch $@

demo: $(DEMO_VENV)/.ready
	$(DEMO_VENV)/bin/standoff demo --out demo --overwrite

# The wheel alone in an empty environment, elsewhere: what it needs must be in it, and nothing else may be needed.
demo-clean:
	folder=$$(mktemp -d); trap 'rm -rf "$$folder"' EXIT; \
	$(PYTHON) -m venv "$$folder/venv"; \
	"$$folder/venv/bin/python" -m pip wheel --quiet --no-deps --wheel-dir "$$folder" .; \
	"$$folder/venv/bin/python" -m pip install --quiet --constraint requirements.lock "$$folder"/standoff-*.whl; \
	cd "$$folder"; env -i HOME="$$folder" venv/bin/standoff demo --out out --json found.json; \
	venv/bin/python -c 'import importlib.util as u, json; found = json.load(open("found.json")); \
	  extra = [n for n in ("torch", "onnx", "moderngl", "trimesh", "pycocotools") if u.find_spec(n)]; \
	  missed = [one["kind"] for one in found["encounters"] if not one["recognised"]]; \
	  assert (extra, missed, found["false_hazards"]) == ([], [], []), (extra, missed, found["false_hazards"])'

# Real footage. It may not be redistributed, so it is not here.
demo-pets: $(READY)
	@test -f $(SHARED)/pets2009/vtest.avi && test -f $(YOLO).weights || \
	  { echo "demo-pets needs pets2009/ and weights/ in $(SHARED); set SHARED=/path/to/data, or use make demo"; exit 2; }
	@mkdir -p demo-pets
	$(BIN)/standoff export --cfg $(YOLO).cfg --weights $(YOLO).weights --names $(dir $(YOLO))coco.names \
	  --size 768x576 --out demo-pets/yolo-fastest.onnx
	$(BIN)/standoff run $(SHARED)/pets2009/vtest.avi --config examples/pets2009/site.yaml \
	  --model demo-pets/yolo-fastest.onnx --out demo-pets/run --overwrite
	$(BIN)/standoff evaluate positions demo-pets/run --truth $(SHARED)/pets2009/gt.csv --frames 1-219
	@echo "open demo-pets/run/report.html and demo-pets/run/annotated.mp4"

lock: $(READY)
	$(BIN)/python -m pip install --quiet pip-tools
	$(BIN)/pip-compile --quiet --upgrade --all-extras --strip-extras --no-header --no-annotate --no-emit-index-url \
	  --no-emit-find-links --no-emit-trusted-host --output-file requirements.lock pyproject.toml simulator/pyproject.toml
	sed -i 's/+cpu$$//' requirements.lock

clean:
	rm -rf $(VENV) $(DEMO_VENV) demo demo-pets site .coverage .mypy_cache .ruff_cache .hypothesis
