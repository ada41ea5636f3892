# Everything happens in .venv, made with the pinned versions of constraints.txt.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
WORKERS ?= 2

PIP = $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt

.PHONY: demo demo-summary demo-model docs test test-all check bench gpu results torture harnesses dist clean

demo: $(VENV)/.runtime
	mkdir -p demo
	$(BIN)/scenegen render --n 64 --out demo/rooms.h5 --overwrite
	$(BIN)/scenegen preview demo/rooms.h5 --out demo/rooms.png --overwrite
	$(BIN)/scenegen verify demo/rooms.h5
	$(BIN)/scenegen info demo/rooms.h5
	$(BIN)/scenegen render --n 4 --preset shapenet --views 0,35,80 --out demo/objects.h5 --overwrite
	$(BIN)/scenegen preview demo/objects.h5 --out demo/objects.png --overwrite
	$(BIN)/iqtt make-split --out demo/iqtt --overwrite
	$(BIN)/iqtt audit demo/iqtt --json demo/audit.json --overwrite
	$(BIN)/iqtt show demo/iqtt/iqtt-test.h5 --mark-correct --out demo/questions.png --overwrite
	$(BIN)/scenegen render --n 64 --seed 1 --out demo/train.h5 --overwrite
	$(BIN)/bench baseline constant --train demo/train.h5 --data demo/rooms.h5 --out demo/constant.h5 --overwrite
	$(BIN)/bench baseline mean-depth --train demo/train.h5 --data demo/rooms.h5 --out demo/mean-depth.h5 --overwrite
	$(BIN)/bench baseline nearest --train demo/train.h5 --data demo/rooms.h5 --out demo/nearest.h5 --overwrite
	for name in constant mean-depth; do $(BIN)/bench score demo/$$name.h5 --truth demo/rooms.h5 --json demo/$$name.json --overwrite > /dev/null || exit 1; done
	$(BIN)/bench score demo/nearest.h5 --truth demo/rooms.h5 --json demo/nearest.json --html demo/report.html --overwrite
	$(BIN)/bench leaderboard demo/constant.json demo/mean-depth.json demo/nearest.json --no-paper --format text --no-intervals
	@$(MAKE) --no-print-directory demo-summary

# What `make demo` leaves; it gets here only if all of it was made.
define DEMO_SUMMARY

In $(CURDIR)/demo:

  file            items                what it is
  report.html     1 page               scores of the baseline nearest, with its best and worst rooms
  rooms.png       12 rooms             image, depth, normals and object ids, of rooms.h5
  objects.png     12 images            four scenes of everyday objects, each from three sides
  questions.png   8 questions          mental rotation, with the right answers
  rooms.h5        64 images            rooms with exact ground truth, to test on
  train.h5        64 images            other rooms, to learn from
  objects.h5      12 images            the everyday objects
  iqtt            1,400 questions      1,000 for training, 200 for validation, 200 for test
  audit.json      1 audit              what was proved and guessed of these questions
  *.json, *.h5    3 of each            scores and predictions of constant, mean-depth and nearest

Open first:  $(CURDIR)/demo/report.html
Then try:    source $(VENV)/bin/activate
             scenegen preview demo/rooms.h5 --random 6
             bench compare demo/mean-depth.json demo/nearest.json
Learn more:  $(CURDIR)/docs/tutorial.md, to scores of a model of your own in 15 minutes
endef
export DEMO_SUMMARY

demo-summary:
	@printf '%s\n' "$$DEMO_SUMMARY"

demo-model: demo $(VENV)/.model
	$(BIN)/bench baseline pix2shape-rays --data demo/rooms.h5 --out demo/pix2shape.h5 --overwrite
	$(BIN)/bench score demo/pix2shape.h5 --truth demo/rooms.h5 --json demo/pix2shape.json --html demo/pix2shape.html --overwrite
	$(BIN)/bench leaderboard demo/constant.json demo/mean-depth.json demo/nearest.json demo/pix2shape.json --no-paper --format text --no-intervals
	$(BIN)/bench baseline pix2shape-views --data demo/iqtt/iqtt-test.h5 --out demo/answers.h5 --overwrite
	$(BIN)/bench score demo/answers.h5 --truth demo/iqtt/iqtt-test-answers.h5
	$(BIN)/pix2shape rotate --data demo/objects.h5 --items 0,3,6,9 --out demo/rotation.gif --overwrite
	$(BIN)/pix2shape sample --out demo/samples.png --overwrite
	@echo
	@echo "Look at $(CURDIR)/demo: pix2shape.html, rotation.gif, samples.png"

# Writes docs/ as a site to site/, which needs no server: open site/index.html.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

test: $(VENV)/.test
	$(BIN)/python -m pytest -q -n $(WORKERS) -m "not slow"

# VLMEvalKit and lmms-eval want other versions, so each has an environment of its own, of 7 GB.
# `make test-all` runs them where these are.
harnesses:
	$(PYTHON) -m venv .venv-vlmeval
	.venv-vlmeval/bin/python -m pip install -q --disable-pip-version-check ms-vlmeval==0.0.20
	$(PYTHON) -m venv .venv-lmms_eval
	.venv-lmms_eval/bin/python -m pip install -q --disable-pip-version-check lmms-eval==0.7.3 'filelock<4'

test-all: $(VENV)/.dev check
	$(BIN)/python -m pytest -q -n $(WORKERS)

check: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

bench: $(VENV)/.test
	$(BIN)/python -m benchmarks.rendering.render
	$(BIN)/python -m benchmarks.rendering.questions
	$(BIN)/python -m benchmarks.rendering.stream
	$(BIN)/python -m benchmarks.rendering.interiors_speed
	$(BIN)/python -m benchmarks.scoring.nearest
	$(BIN)/python -m benchmarks.surfels
	$(BIN)/python -m benchmarks.scoring.score_rows

# Nine minutes on a machine with an NVIDIA GPU, without network; gpu/result/tables.md shows it.
gpu: $(VENV)/.test
	$(BIN)/python -m benchmarks.gpu.run

# Hours; stop it when you like, and start it again. RESULTS="--only questions --seeds 1" runs a part.
results: $(VENV)/.model
	$(BIN)/python -m benchmarks.results $(RESULTS)

# Fifteen minutes of runs that meet kills, signals, full disks and more, and then go on.
torture: $(VENV)/.test
	$(BIN)/python -m benchmarks.torture

# A wheel and an sdist; each is installed in a fresh environment of every Python there is, and tried.
dist: $(BIN)/python
	rm -rf dist build
	$(PIP) build
	$(BIN)/python -m build --outdir dist . > /dev/null
	$(BIN)/python tests/smoke.py dist

clean:
	rm -rf $(VENV) demo site build dist *.egg-info

$(BIN)/python:
	$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 11) <= v <= (3, 13) else f"Python 3.11 to 3.13 is needed, {sys.executable} is {v[0]}.{v[1]}; say make PYTHON=...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) -e .
	touch $@

$(VENV)/.docs: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) -e '.[docs]'
	touch $@ $(VENV)/.runtime

$(VENV)/.model: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) -e '.[model]'
	touch $@ $(VENV)/.runtime

# Without bytecode: libraries are compiled when they are first imported.
$(VENV)/.test: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) --no-compile -e '.[test]'
	touch $@ $(VENV)/.runtime $(VENV)/.model

$(VENV)/.dev: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) --no-compile -e '.[dev]'
	touch $@ $(VENV)/.runtime $(VENV)/.model $(VENV)/.docs $(VENV)/.test
