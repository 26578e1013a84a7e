# Everything a fresh machine needs comes with these targets; each sets up what it uses.
VENV := .venv
PY := $(VENV)/bin/python
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export ICO3D_PYTHON := $(CURDIR)/$(PY)
# importing takes three times as long where every process compiles what it imports
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo demo-natural test quick quick-unit install viewer lint strict page unit e2e e2e-beside e2e-alone bench clean

demo: $(VENV)/.serve src/ico3d/chat/static/index.html ## talk with the packaged avatar
	$(VENV)/bin/ico3d demo $(if $(PORT),--port $(PORT))

demo-natural: $(VENV)/.serve src/ico3d/chat/static/index.html ## the same with Whisper, a small language model and a natural voice
	$(VENV)/bin/ico3d demo --natural $(if $(PORT),--port $(PORT))

test: ## everything CI runs
	$(MAKE) --no-print-directory -j 2 install # Python's packages and the page's, side by side
	$(MAKE) --no-print-directory -j 3 e2e-alone $(VENV)/.kernels page # all but the first give way
	$(MAKE) --no-print-directory -j 4 unit e2e-beside strict lint # browsers mostly wait for speech; checks take what is left

quick: $(VENV)/.kernels src/ico3d/chat/static/index.html ## what one runs while working: checks, and the tests that take no time
	ruff check . && ruff format --check .
	$(MAKE) --no-print-directory -j 2 page quick-unit

quick-unit:
	$(PY) -m pytest -n 2 --dist loadfile -m "not slow"

install: $(VENV)/.develop src/ico3d/chat/static/index.html ## training, tracking, tests

viewer: src/ico3d/chat/static/index.html ## the page that servers serve

# what gives way to tests that keep time
ASIDE := nice -n 19

lint: $(VENV)/.develop
	ruff check . && ruff format --check .
	$(ASIDE) pyrefly check
	$(ASIDE) lint-imports

strict: $(VENV)/.develop # rooms in which no type may be unknown, which pyright alone can tell
	NODE_OPTIONS=--max-semi-space-size=64 $(ASIDE) pyright # a tenth of its time would go into small collections

page: src/ico3d/chat/static/index.html
	cd viewer && $(ASIDE) npm run --silent check && $(ASIDE) npm run --silent test

unit: $(VENV)/.develop $(VENV)/.kernels src/ico3d/chat/static/index.html
	# three files at a time on two cores: talking with an avatar is mostly waiting, and each more process
	# takes five seconds of a core to import and collect
	$(PY) -m pytest -n 3 --dist loadfile --no-loadscope-reorder --durations 15

e2e: e2e-beside e2e-alone ## the page in a real browser

e2e-beside: $(VENV)/.develop src/ico3d/chat/static/index.html
	cd viewer && npx vitest run --project e2e

e2e-alone: $(VENV)/.develop src/ico3d/chat/static/index.html # judges milliseconds
	cd viewer && npx vitest run --project 'e2e alone'

SUBJECT ?= anny
RESULTS ?= runs/bench
bench: install ## long quality and speed runs; figures go to docs/benchmarks.md
	ico3d capture synthetic $(RESULTS)/capture --subject $(SUBJECT) --cameras 6 --frames 1100 --views-per-frame 1 --size 256
	ico3d measure ablations $(RESULTS)/capture $(RESULTS)/head --of head --inputs blendshapes --seeds 3
	$(PY) bench/bake.py $(RESULTS)/head/whole-method/seed0 $(RESULTS)/capture --json $(RESULTS)/bake.json
	$(if $(OPPONENT),ico3d bench raster --against $(OPPONENT) --json $(RESULTS)/raster.json)
	$(PY) bench/step.py $(RESULTS)/capture --json $(RESULTS)/step.json
	$(PY) bench/gpu.py --out $(RESULTS)/gpu
	$(PY) bench/files.py src/ico3d/chat/data/demo.ico3d --json $(RESULTS)/files.json
	$(if $(filter %.npz,$(SUBJECT)),$(PY) bench/stress.py $(SUBJECT) --json $(RESULTS)/stress.json)
	$(if $(filter %.npz,$(SUBJECT)),$(PY) bench/kills $(SUBJECT) $(RESULTS)/kills)
	ico3d bench chat --json $(RESULTS)/chat.json
	cd viewer && npm run --silent bench

clean:
	rm -rf $(VENV) viewer/node_modules src/ico3d/chat/static

$(VENV)/.node: scripts/setup.sh
	scripts/setup.sh node

$(VENV)/.serve: pyproject.toml constraints.txt scripts/setup.sh | $(VENV)/.node
	scripts/setup.sh serve

$(VENV)/.develop: pyproject.toml constraints.txt scripts/setup.sh | $(VENV)/.node
	scripts/setup.sh develop

KERNELS := $(shell grep -rlE --include=*.py '^@(kernel|njit|subroutine)' src)
$(VENV)/.kernels: $(VENV)/.develop $(KERNELS)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 PYTHONPATH=tests $(ASIDE) $(PY) -m support.compile_kernels >/dev/null
	touch $@

viewer/node_modules/.package-lock.json: viewer/package-lock.json | $(VENV)/.node
	cd viewer && npm ci --no-audit --no-fund --silent

VIEWER_SOURCES := $(shell find viewer/src viewer/index.html viewer/public -type f 2>/dev/null)
src/ico3d/chat/static/index.html: viewer/node_modules/.package-lock.json $(VIEWER_SOURCES) viewer/vite.config.ts viewer/compression.ts viewer/webassembly.ts
	cd viewer && npm run --silent build && touch ../$@
