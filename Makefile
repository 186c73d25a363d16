# Everything runs from .venv in this folder; `make run` and `make test` build it when it is missing or out of date.
PYTHON := .venv/bin/python
JOBS ?= 2
PLATFORMS := linux win32 darwin
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
	$(MAKE) --no-print-directory -j $(JOBS) $(PLATFORMS:%=types-on-%)

types-on-%:
	.venv/bin/mypy --platform $* --cache-dir .mypy_cache/$*

measure: setup
	$(PYTHON) -m app measure -o out/measure $(ARGS)

clean:
	rm -rf .venv out build *.egg-info
