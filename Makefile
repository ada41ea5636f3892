# Everything happens in .venv, made with the pinned versions of constraints.txt.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
WORKERS ?= 2
# Where bytecode is not kept, each process of a test compiles all libraries again.
unexport PYTHONDONTWRITEBYTECODE
# The workers share the processors; threads of small products would spin beside them.
test: export OPENBLAS_NUM_THREADS = 1

PIP = $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt

.PHONY: demo demo-summary demo-model docs test test-all check bench gpu results torture harnesses dist clean

demo: $(VENV)/.demo
	mkdir -p demo
	$(BIN)/scenegen render --preset interiors --n 2 --size 256 --denoise --out demo/interiors.h5 --overwrite
	$(BIN)/scenegen preview demo/interiors.h5 --out demo/interiors.png --overwrite
	$(BIN)/scenegen render --n 64 --out demo/rooms.h5 --overwrite
	$(BIN)/scenegen preview demo/rooms.h5 --out demo/rooms.png --overwrite
	$(BIN)/scenegen verify demo/rooms.h5
	$(BIN)/iqtt make-split --out demo/iqtt --overwrite
	$(BIN)/iqtt show demo/iqtt/iqtt-test.h5 --mark-correct --out demo/questions.png --overwrite
	$(BIN)/scenegen render --n 64 --seed 1 --out demo/train.h5 --overwrite
	for name in mean-depth nearest; do $(BIN)/bench baseline $$name --train demo/train.h5 --data demo/rooms.h5 --out demo/$$name.h5 --overwrite || exit 1; done
	$(BIN)/bench score demo/nearest.h5 --truth demo/rooms.h5 --html demo/report.html --overwrite
	$(BIN)/bench compare demo/mean-depth.h5 demo/nearest.h5 --truth demo/rooms.h5 --metric abs_rel
	@$(MAKE) --no-print-directory demo-summary

# What `make demo` leaves; it gets here only if all of it was made.
define DEMO_SUMMARY

In $(CURDIR)/demo:

  interiors.png   2 furnished rooms: image, depth, normals and object ids, of interiors.h5
  rooms.png       12 of 64 simple rooms, of rooms.h5
  questions.png   8 of 1,400 mental-rotation questions, with the correct option, of iqtt
  report.html     scores of the baseline `nearest`, with its best and worst images
  train.h5, mean-depth.h5, nearest.h5: what the baselines learned from, and their predictions

Open first:  $(CURDIR)/demo/interiors.png and report.html
Learn more:  $(CURDIR)/docs/tutorial.md: from rendering to scores in 15 minutes
endef
export DEMO_SUMMARY

demo-summary:
	@printf '%s\n' "$$DEMO_SUMMARY"

demo-model: demo $(VENV)/.model
	$(BIN)/bench baseline pix2shape-rays --data demo/rooms.h5 --out demo/pix2shape.h5 --overwrite
	$(BIN)/bench score demo/pix2shape.h5 --truth demo/rooms.h5 --html demo/pix2shape.html --overwrite
	$(BIN)/bench leaderboard demo/mean-depth.h5 demo/nearest.h5 demo/pix2shape.h5 --truth demo/rooms.h5 --no-paper --format text --no-intervals
	$(BIN)/bench baseline pix2shape-views --data demo/iqtt/iqtt-test.h5 --out demo/answers.h5 --overwrite
	$(BIN)/bench score demo/answers.h5 --truth demo/iqtt/iqtt-test-answers.h5
	$(BIN)/scenegen render --n 4 --preset shapenet --views 0,35,80 --out demo/objects.h5 --overwrite
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

$(VENV)/.demo: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) -e '.[denoise]'
	touch $@ $(VENV)/.runtime

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
