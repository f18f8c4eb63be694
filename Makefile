# Two commands on a fresh machine: `make demo` and `make test`. `make help` lists the rest.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2

# Byte code is what makes the second start fast: it is written even where the environment forbids it.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test test-slow bench lint docs clean

help:
	@echo "make demo       install, then simulate a drive and process it into demo-output/"
	@echo "make test       install, check the code, run the tests (some minutes)"
	@echo "make test-slow  the tests left out of 'make test'"
	@echo "make bench      speed and accuracy, with other tools beside"
	@echo "make lint       ruff, import layers, pyright"
	@echo "make docs       the manual, as docs/_build/html/index.html"
	@echo "make clean      remove what these commands made"

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --compile --editable .
	$(BIN)/python -m compileall -q src
	@touch $@

$(VENV)/.installed-%: pyproject.toml $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --compile --editable ".[$*]"
	@touch $@

demo: $(VENV)/.installed
	@$(BIN)/python -m compileall -q src
	@$(BIN)/navfuse demo -o demo-output

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check
	$(BIN)/lint-imports
	$(BIN)/pyright

test: lint
	@$(BIN)/python -m compileall -q src
	$(BIN)/python -m pytest -n $(WORKERS) -m "not slow"

test-slow: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n $(WORKERS) -m slow

bench: $(VENV)/.installed-bench
	@$(BIN)/python -m compileall -q src
	$(BIN)/python -m benchmarks

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo "Open docs/_build/html/index.html"

clean:
	rm -rf $(VENV) demo-output docs/_build docs/_generated dist build .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests benchmarks examples docs -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
