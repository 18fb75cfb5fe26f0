# make demo   install and render the built-in world into demo/
# make test   install and run the tests
# make bench  install and time the presets, other denoisers, and how time grows: under ten minutes
# make check  install and run the linters, the type checker and the layer test
PYTHON ?= python3.11
ifeq ($(shell command -v $(PYTHON) 2>/dev/null),)
PYTHON := python3
endif
BIN := .venv/bin
export GBUFRT_TEST_DATA ?= $(wildcard $(abspath ../shared/data))
ifeq ($(GBUFRT_TEST_DATA),)
unexport GBUFRT_TEST_DATA
endif

.PHONY: install demo test bench check clean
install: .venv/installed

# --no-compile: most modules are never imported; those that are get compiled then
.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '.[dev]'
	@touch $@

demo: install
	$(BIN)/gbufrt render --size 640x360 --warmup 1 --out demo

# two workers of one thread: more would wait for one another; each has half of the tests, see tests/conftest.py.
# Byte code is kept even where the environment forbids it: the tests start dozens of processes, and all import torch
test: install
	PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OMP_WAIT_POLICY=PASSIVE $(BIN)/python -m pytest -n 2 --dist worksteal

bench: install
	$(BIN)/gbufrt bench --presets low,medium,high --peers --scaling

check: install
	$(BIN)/ruff check --no-cache .
	$(BIN)/ruff format --no-cache --check .
	$(BIN)/pyright
	$(BIN)/python -m pytest tests/test_layers.py

clean:
	rm -rf .venv demo
