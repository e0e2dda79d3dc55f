# One file for every chore. `make` alone lists them.

.DEFAULT_GOAL := help
SHELL := /bin/sh

# The first Python that is new enough; `make setup PYTHON=...` overrides it. Recursive,
# so that `make help` does not look for it.
PYTHON ?= $(shell for python in python3 python3.13 python3.12 python3.11; do \
	$$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& echo $$python && break; done)
BIN := .venv/bin

# Two workers fit two cores and a laptop's memory: each worker holds a JAX of its own.
WORKERS ?= 2
PYTEST_ARGS ?=
PYTEST := -m pytest -n $(WORKERS) --dist worksteal

# pip-compile alone must not see this machine's pip settings: an extra index or a folder
# of wheels would put its own versions and hashes into the lock.
PIP_TOOLS := pip-tools==7.6.2
PLAIN_PIP := env -u PIP_FIND_LINKS -u PIP_EXTRA_INDEX_URL -u PIP_INDEX_URL \
	PIP_CONFIG_FILE=/dev/null CUSTOM_COMPILE_COMMAND="make lock"
COMPILE := $(PLAIN_PIP) .venv-lock/bin/pip-compile --quiet --build-deps-for wheel \
	--generate-hashes --strip-extras --allow-unsafe --no-annotate \
	--no-emit-index-url --no-emit-find-links --no-emit-trusted-host
UPGRADE ?=

.PHONY: help setup setup-dev test demo check format bench docs lock lower-bounds torch-env clean

help:  ## List the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) \
	| sed -E 's/^([a-z-]+):.*## /\1 /' \
	| while read -r name text; do printf '  make %-14s %s\n' "$$name" "$$text"; done

setup:  ## Make .venv from requirements.lock when it is missing or stale
	@sh tools/setup.sh "$(PYTHON)" base

setup-dev:  ## Also install what tests and checks need
	@sh tools/setup.sh "$(PYTHON)" dev

test: setup-dev  ## Run the test suite (PYTEST_ARGS='tests/engines -k slides' for a part)
	$(BIN)/python $(PYTEST) $(PYTEST_ARGS)

demo: setup  ## Show the whole method, small, in runs/demo/report.html
	$(BIN)/sainet demo

check: setup-dev  ## Lint, format, types and layers
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright
	$(BIN)/lint-imports

format: setup-dev  ## Rewrite the sources the way `make check` wants them
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# KEEP='PATH ...' first puts evidence into results/: folders of studies and of
# 'sainet identify', and files with the JSON of 'sainet bench'.
pages: setup  ## Render docs/results/, figures and README.md from results/
	$(BIN)/python -m sainet.studies.pages $(KEEP)

# The programs of the tutorials run; DOCS_ARGS='-D nb_execution_mode=off' leaves them out.
docs: setup-dev  ## Build the documentation in docs/_build/html/index.html
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/sphinx-build -q -W --keep-going -E \
		-b html $(DOCS_ARGS) docs docs/_build/html

bench: setup-dev  ## Run the benchmarks
	$(BIN)/sainet bench

lock:  ## Remake both locks, on Python 3.11 (UPGRADE=--upgrade for newer versions)
	python3.11 -m venv --clear .venv-lock
	$(PLAIN_PIP) .venv-lock/bin/pip install -qq $(PIP_TOOLS)
	$(COMPILE) $(UPGRADE) --output-file requirements.lock pyproject.toml
	$(COMPILE) $(UPGRADE) --constraint requirements.lock --extra test --extra dev \
		--extra docs --output-file requirements-dev.lock pyproject.toml
	# Made on Python 3.11, the lock would ask for it on newer ones as well.
	sed -i -e 's/^pybullet==\([^ ;]*\) \\/pybullet==\1 ; python_version < "3.12" \\/' \
		-e '/^$$/d' requirements-dev.lock
	rm -rf .venv-lock

lower-bounds:  ## Run the suite with the oldest dependencies that pyproject.toml allows
	$(PYTHON) -m venv --clear .venv-lower
	$(PYTHON) tools/lower_bounds.py > .venv-lower/pins.txt
	.venv-lower/bin/pip install -qq -c .venv-lower/pins.txt --editable '.[test]'
	# test_wheel.py makes environments of its own with the locked versions.
	.venv-lower/bin/python $(PYTEST) --ignore tests/test_wheel.py $(PYTEST_ARGS)

torch-env:  ## Make benchmarks/.venv with PyTorch, for `sainet bench training` (large)
	$(PYTHON) -m venv --clear benchmarks/.venv
	benchmarks/.venv/bin/pip install -qq -r benchmarks/requirements.txt \
		$(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX))

clean:  ## Remove environments, builds and caches; runs/ and data/ stay
	rm -rf .venv .venv-lock .venv-lower benchmarks/.venv build dist
	rm -rf .pytest_cache .ruff_cache .import_linter_cache
	find src tests tools -name __pycache__ -type d -prune -exec rm -rf {} +
