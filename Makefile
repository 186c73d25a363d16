# Everything runs from .venv in this folder; `make run` and `make test` build it when it is missing or out of date.
PYTHON := .venv/bin/python
JOBS ?= 2
STAMP := .venv/.insitu-setup

.PHONY: setup run test sweep lint measure clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt scripts/setup.sh scripts/install-libraries.sh
	bash scripts/install-libraries.sh
	bash scripts/setup.sh
	touch $(STAMP)

run: setup
	@bash scripts/run.sh $(ARGS)

test: setup
	$(PYTHON) -m pytest -n $(JOBS) --dist loadfile $(ARGS)

sweep: setup
	$(PYTHON) -m pytest -n $(JOBS) --dist loadfile -m sweep $(ARGS)

lint: setup
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
	.venv/bin/mypy --platform win32 --cache-dir .mypy_cache/win32
	.venv/bin/mypy --platform darwin --cache-dir .mypy_cache/darwin

measure: setup
	$(PYTHON) -m app measure -o out/measure $(ARGS)

clean:
	rm -rf .venv out build *.egg-info
