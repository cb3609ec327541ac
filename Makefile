PYTHON ?= python
BENCH_OUT ?= build/benchmarks

.PHONY: check test slow bench peers docs pictures format

check:
	$(PYTHON) -m ruff check src tests
	$(PYTHON) -m ruff format --check src tests
	$(PYTHON) -m pyright
	lint-imports

test:
	$(PYTHON) -m pytest

slow:
	$(PYTHON) -m pytest -m slow

bench:
	$(PYTHON) benchmarks/suite.py $(BENCH_OUT)

peers:
	$(PYTHON) benchmarks/peers --out $(BENCH_OUT)/peers

docs:
	$(PYTHON) docs/write_api.py

pictures:
	$(PYTHON) docs/write_pictures.py

format:
	$(PYTHON) -m ruff format src tests
	$(PYTHON) -m ruff check --fix src tests
