# Every target makes what it needs in .venv; a second call finds it there. PYTHON is any Python from 3.11 on.
PYTHON ?= python3
BIN := .venv/bin
MADE := .venv/.made
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --quiet --only-binary :all: -c constraints.txt

# A file's tests stay in one process, where they share what is compiled.
PYTEST := $(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist loadfile

.DEFAULT_GOAL := help
.PHONY: help demo test check test-all bench docs clean

help:
	@echo "make demo      simulate a recording with a faint source, track it, leave a report in demo/"
	@echo "make test      tests and examples in docstrings"
	@echo "make check     format, lint, types, layers, tests"
	@echo "make test-all  tests, the slow ones too"
	@echo "make bench     speed, beside its peers"
	@echo "make docs      documentation in docs/_build/html"
	@echo "make clean     remove the environment and everything built"

demo: $(MADE)/run
	$(BIN)/faintrack demo --out demo

test: $(MADE)/test
	$(PYTEST)

check: $(MADE)/dev
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(PYTEST)

test-all: $(MADE)/dev
	$(PYTEST) -m ""

bench: $(MADE)/dev
	$(BIN)/faintrack bench

docs: $(MADE)/dev
	$(BIN)/python -m sphinx -W --keep-going -b html docs docs/_build/html

clean:
	rm -rf .venv build dist demo docs/_build docs/gallery docs/sg_execution_times.rst
	rm -rf .cache .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis src/*.egg-info
	find src tests docs examples -name __pycache__ -type d -prune -exec rm -rf {} +

# What is installed, one stamp each; a larger set holds the smaller ones.
$(MADE)/run: pyproject.toml constraints.txt | $(MADE)
	$(INSTALL) -e .
	@touch $@

$(MADE)/test: pyproject.toml constraints.txt | $(MADE)
	$(INSTALL) -e ".[test]"
	@touch $@ $(MADE)/run

$(MADE)/dev: pyproject.toml constraints.txt | $(MADE)
	$(INSTALL) -e ".[dev]"
	@touch $@ $(MADE)/test $(MADE)/run

$(MADE):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
	  { echo "$(PYTHON) is missing or older than Python 3.11; name another: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "$(PYTHON) cannot make environments, ensurepip is missing (Debian, Ubuntu: install python3-venv)"; exit 1; }
	$(PYTHON) -m venv .venv
	@mkdir -p $@
