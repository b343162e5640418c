# Two commands: `make quickstart` and `make test`. Both install what is missing first (scripts/setup.sh).
# More arguments: make quickstart ARGS="--steps 2000"     make test ARGS="-k registry"
SHELL := /bin/bash
BIN := .venv/bin
ARGS ?=
# The scenes that the result is judged by, and that are never trained on.
HOLDOUT ?= bottles foliage

.PHONY: help clients setup setup-tests peers quickstart bench bench-gpu check test lint format docs lock clean

help: ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

setup: ## virtual environment, dependencies, OpenGL
	@scripts/setup.sh

quickstart: setup ## sample scenes, then the main job on them; prints where the report is
	$(BIN)/diaphane samples samples
	$(BIN)/diaphane build samples/*.usd* --name quickstart $(addprefix --holdout ,$(HOLDOUT)) $(ARGS)

bench: setup ## every technique on the committed suite; goes on where it stopped (hours; ARGS="--quick": minutes)
	$(BIN)/python -m benchmarks.suite $(ARGS)

bench-gpu: setup ## this machine's graphics card in ten minutes, unattended: one file for benchmarks/results
	$(BIN)/python -m benchmarks.gpu $(ARGS)

peers: ## OpenUSD's Storm in .venv-peers, to compare with (400 MB, GPL; nothing else here uses it)
	@scripts/peers.sh

lint: setup ## style, types, direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	PYTHONPATH=deploy/client/python $(BIN)/lint-imports

setup-tests:
	@scripts/setup-tests.sh

check: setup ## lint, and the quick tests of single modules and of documents: while you work; installs nothing more
	@scripts/test.sh check

test: ## lint, and all tests, in lanes (CONTRIBUTING.md)
	@$(MAKE) --no-print-directory --jobs=2 --output-sync=target setup setup-tests
	@scripts/test.sh $(ARGS)

format: setup ## rewrite the sources in the house style
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: ## the documents as a site, with the Python reference: build/site/index.html
	@scripts/docs.sh

clients: ## what the service has of deploy/client/web: demo, examples, and packages for npm (needs node)
	cd deploy/client/web && npm ci --ignore-scripts --no-audit --no-fund && npm run build

lock: ## all locks anew from pyproject.toml (with the uv of .venv, if there is no other)
	scripts/lock.sh

clean: ## remove the environment, caches and the samples; keeps .diaphane
	rm -rf .venv build ./*.egg-info samples .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
