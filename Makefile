# Everything runs from .venv in this folder; `make run` and `make test` build it when it is missing or out of date.
PYTHON := .venv/bin/python
JOBS ?= 2
PLATFORMS := linux win32 darwin
STAMP := .venv/.insitu-setup
# Bytecode is kept, whatever the environment says: tests and the editor start processes that would compile all sources.
export PYTHONDONTWRITEBYTECODE :=
# Small tests: what runs with the bounds of each index checked, and what can wait for kernels that are not compiled
# (`engine/core/lanes.py`, which samples pyramids, is the compiler's alone).
BOUNDS_CHECKED := $(addprefix tests/engine/,curve light material measured precompute realtime reference render scene sphere texture visibility)
BOUNDS_CHECKED += tests/benchmarks/test_thesis_visibility.py
UNCOMPILED := $(addprefix tests/engine/,curve material texture/test_texture_files.py texture/test_strokes.py realtime/zonal_harmonics/test_pose.py \
	realtime/zonal_harmonics/test_extremes.py precompute/indirect/test_smoothing.py light/test_radiance_files.py light/test_hdr_files.py \
	measured/test_sample_files.py sphere/test_harmonics.py sphere/test_haar.py precompute/direct/test_bandstore.py)

.PHONY: setup run test wheel docs sweep checked coverage fuzz lint measure clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt scripts/setup.sh scripts/install-libraries.sh
	bash scripts/install-libraries.sh
	bash scripts/setup.sh
	touch $(STAMP)

run: setup
	@bash scripts/run.sh $(ARGS)

test: setup
	$(PYTHON) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder $(ARGS)

# The wheel in dist/, and a try of it in an environment of its own.
wheel: setup
	rm -rf dist build
	$(PYTHON) -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	bash scripts/try-wheel.sh

# The documentation as web pages, in out/docs/site.
docs: setup
	$(PYTHON) -m scripts.build_docs out/docs

sweep: setup
	$(PYTHON) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder -m sweep $(ARGS)

# Kernels that check their bounds are other ones than those that are kept for the program.
checked: setup
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/out/checked $(PYTHON) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder $(BOUNDS_CHECKED) $(ARGS)
	NUMBA_DISABLE_JIT=1 $(PYTHON) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder $(UNCOMPILED) $(ARGS)

coverage: setup
	NUMBA_DISABLE_JIT=1 $(PYTHON) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --cov --cov-report=term --cov-report=html:out/coverage $(UNCOMPILED) $(ARGS)

fuzz: setup
	$(PYTHON) -m tests.fuzz.run --jobs $(JOBS) $(ARGS)

lint: setup
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	$(MAKE) --no-print-directory -j $(JOBS) $(PLATFORMS:%=types-on-%)

types-on-%:
	.venv/bin/mypy --platform $* --cache-dir .mypy_cache/$*

measure: setup
	$(PYTHON) -m benchmarks -o out/measure $(ARGS)

clean:
	rm -rf .venv out build dist *.egg-info
