PYTHON ?= python
BENCH_OUT ?= build/benchmarks
SPHINX = $(PYTHON) -m sphinx -W --keep-going -q

.PHONY: check test slow reliability bench peers pages pictures docs pdf dist format

check:
	$(PYTHON) -m ruff check src tests docs benchmarks
	$(PYTHON) -m ruff format --check src tests docs benchmarks
	$(PYTHON) -m pyright
	lint-imports

test:
	$(PYTHON) -m pytest

slow:
	$(PYTHON) -m pytest -m slow -n 0

reliability:
	$(PYTHON) benchmarks/reliability.py
	$(PYTHON) benchmarks/pages.py reliability docs

bench:
	$(PYTHON) benchmarks/suite.py $(BENCH_OUT)

peers:
	$(PYTHON) benchmarks/peers --out $(BENCH_OUT)/peers

pages:
	$(PYTHON) benchmarks/pages.py all docs

docs:
	$(PYTHON) docs/write_api.py
	$(SPHINX) -b html docs build/site
	$(PYTHON) docs/check_site.py build/site

pdf:
	$(SPHINX) -b singlehtml docs build/single
	$(PYTHON) docs/print_pdf.py build/single/index.html build/granufab.pdf

dist:
	$(PYTHON) -m build --outdir dist .

pictures:
	$(PYTHON) docs/write_pictures.py

format:
	$(PYTHON) -m ruff format src tests docs benchmarks
	$(PYTHON) -m ruff check --fix src tests docs benchmarks
