# Two jobs for a newcomer: `make reproduce` and `make test`. Both build .venv first if it is not there.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out/paper

.PHONY: reproduce test bench lint clean help

help:
	@echo "make reproduce   fly the paper's five experiments on both plants; results in $(OUT)"
	@echo "make test        lint, types, import contract, every test"
	@echo "make bench       measure every engine on this machine; numbers in out/bench.json"
	@echo "make lint        ruff, mypy, import contract"

$(VENV)/.core: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/.test: $(VENV)/.core
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test]"
	@touch $@

reproduce: $(VENV)/.core
	$(BIN)/python -m skyarm reproduce --out $(OUT)

lint: $(VENV)/.test
	$(BIN)/ruff check src tests
	$(BIN)/ruff format --check src tests
	$(BIN)/mypy
	$(BIN)/lint-imports

test: lint
	$(BIN)/pytest

bench: $(VENV)/.core
	$(BIN)/python -m skyarm bench --json out/bench.json

clean:
	rm -rf $(VENV) out build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
