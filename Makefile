# make test   everything that CI checks
# make demo   the main job on real footage, all set-up included
# Both set themselves up on a fresh Debian or Ubuntu with python3 and make.

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

.PHONY: help setup test lint types contracts unit demo docs bench lock clean

help:
	@sed -n 's/^# make/make/p' Makefile

setup: $(READY)

# The lock fixes every version; the test oracles come without their dependencies, because those would
# bring a second OpenCV that overwrites the headless one.
$(READY): pyproject.toml requirements.lock requirements-oracles.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "standoff needs Python 3.11 or newer; found $$($(PYTHON) --version). Set PYTHON=/path/to/python3.11."; exit 2; }
	@test -x $(BIN)/python && $(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV) || $(MAKE) --no-print-directory venv-by-apt
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint requirements.lock --editable '.[dev,train,sim]'
	$(BIN)/python -m pip install --quiet --no-deps --requirement requirements-oracles.txt
	@touch $@

.PHONY: venv-by-apt
venv-by-apt:
	@sudo=$$([ "$$(id -u)" = 0 ] || echo sudo -n); command -v apt-get >/dev/null || \
	  { echo "python3 has no venv module: install it (python3-venv) and run make again."; exit 2; }; \
	$$sudo apt-get update -qq && $$sudo apt-get install -y -qq python3-venv && $(PYTHON) -m venv --clear $(VENV)

test: lint types contracts unit

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

contracts: $(READY)
	$(BIN)/lint-imports

unit: $(READY)
	$(BIN)/python -m pytest -n $(WORKERS) --cov --cov-report=term --cov-fail-under=95

bench: $(READY)
	$(BIN)/python -m pytest benchmarks -p no:xdist --benchmark-only --benchmark-columns=median,iqr,rounds

docs: $(READY)
	$(BIN)/mkdocs build --strict

# The data may not be redistributed, so it is not here; the drawn site of examples/ needs none.
demo: $(READY)
	@test -f $(SHARED)/pets2009/vtest.avi && test -f $(YOLO).weights || \
	  { echo "the demo needs pets2009/ and weights/ in $(SHARED); set SHARED=/path/to/data, or see examples/drawn_site"; exit 2; }
	@mkdir -p demo
	$(BIN)/standoff export --cfg $(YOLO).cfg --weights $(YOLO).weights --names $(dir $(YOLO))coco.names \
	  --size 768x576 --out demo/yolo-fastest.onnx
	$(BIN)/standoff run $(SHARED)/pets2009/vtest.avi --config examples/pets2009/site.yaml \
	  --model demo/yolo-fastest.onnx --out demo/run --overwrite
	$(BIN)/standoff evaluate positions demo/run --truth $(SHARED)/pets2009/gt.csv --frames 1-219
	@echo "open demo/run/report.html and demo/run/annotated.mp4"

lock: $(READY)
	$(BIN)/python -m pip install --quiet pip-tools
	$(BIN)/pip-compile --quiet --upgrade --all-extras --strip-extras --no-header --no-annotate --no-emit-index-url \
	  --no-emit-find-links --no-emit-trusted-host --output-file requirements.lock pyproject.toml
	sed -i 's/+cpu$$//' requirements.lock

clean:
	rm -rf $(VENV) demo site .coverage .mypy_cache .ruff_cache .hypothesis
