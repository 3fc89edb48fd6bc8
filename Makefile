# `make demo` and `make test` set up everything they need in .venv, from a Python and nothing else.
SUPPORTED := 3.10 3.11 3.12 3.13
VENV := .venv
BIN := $(VENV)/bin
OUT := out
PIP := -m pip install --quiet --disable-pip-version-check
PINS := $(wildcard requirements/*.txt)
NO_PYTHON := needs Python 3.10 or newer with the module venv (Debian and Ubuntu: \
	apt install python3-venv), or name one: make PYTHON=/path/to/python

.DEFAULT_GOAL := help
.PHONY: help demo test lint pytest coverage test-all test-pythons test-lowest bench sweep crosscheck agree fuzz odd \
	site man dist clean

help:
	@echo "make demo          set up, build the nine checkpoint stages into $(OUT)/ and check them"
	@echo "make test          set up, then every static check and the test suite"
	@echo "make test-all      the same, then the suite on every other Python $(SUPPORTED) here"
	@echo "                   and on the lowest releases the package allows"
	@echo "make pytest        the test suite alone; TESTS=tests/commands/test_cli.py: one file of it"
	@echo "make coverage      the test suite, and which lines it reaches"
	@echo "make bench         measure speed, and grading a class of a thousand"
	@echo "make sweep         break a stage in every single way and count what is found"
	@echo "make crosscheck    let a dry run drive each broken stage, and compare it with the rules"
	@echo "make agree         ask five commands about every stage of the tests, and count contradictions"
	@echo "make fuzz          throw damaged files at the program"
	@echo "make odd           run the commands on stages with odd values"
	@echo "make site          build the documentation as one site into $(OUT)/site"
	@echo "make man           write a manual page for each command into $(OUT)/man"
	@echo "make dist          build wheel and source archive into dist, and check their descriptions"
	@echo "make clean         remove environments, caches and built files"

demo: $(VENV)/run
	$(BIN)/lab3 build --output $(OUT) --force
	$(BIN)/lab3 check --quiet $(OUT)

test: $(VENV)/dev
	@sh .ci/test $(MAKE)

lint: $(VENV)/dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

pytest: $(VENV)/dev
	sh .ci/suite $(BIN)/python $(TESTS)

coverage: $(VENV)/dev
	sh .ci/suite $(BIN)/python --cov --cov-report=term

test-all: test test-pythons

# One after the other: each environment's suite already uses every worker.
test-pythons: $(VENV)/dev
	@set -eu; tested=$$($(BIN)/python -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
	for version in $(SUPPORTED); do \
		if [ "$$version" = "$$tested" ]; then \
			echo "== Python $$version: tested by make test"; \
		elif sh .ci/find-python "$$version" >/dev/null; then \
			echo "== Python $$version"; $(MAKE) --no-print-directory "test-$$version"; \
		else \
			echo "== Python $$version: SKIPPED, not on this machine"; \
		fi; \
	done
	@echo "== lowest releases"; $(MAKE) --no-print-directory test-lowest

$(SUPPORTED:%=test-%): test-%: .venv-%/dev
	sh .ci/suite .venv-$*/bin/python -q

test-lowest: .venv-lowest/dev
	sh .ci/suite .venv-lowest/bin/python -q

# Commands are timed as users have them: other packages in an environment slow down every start.
bench: $(VENV)/dev .venv-plain/run
	.venv-plain/bin/python benchmarks/bench.py
	$(BIN)/python benchmarks/bench_grade.py --jobs 2
	$(BIN)/python benchmarks/bench_sim.py
	$(BIN)/python benchmarks/bench_watch.py

sweep: $(VENV)/dev
	$(BIN)/python benchmarks/sweep.py

crosscheck: $(VENV)/dev
	$(BIN)/python benchmarks/crosscheck.py

agree: $(VENV)/dev
	$(BIN)/python benchmarks/agree.py

fuzz: $(VENV)/dev
	$(BIN)/python benchmarks/fuzz.py --odd 0.03
	$(BIN)/python benchmarks/damaged_files.py

odd: $(VENV)/dev
	$(BIN)/python benchmarks/odd_values.py

site: $(VENV)/dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build

man: $(VENV)/dev
	$(BIN)/python docs/make_man.py $(OUT)/man

# What a release uploads (.github/workflows/release.yml).
dist: $(VENV)/python
	$(BIN)/python -m venv --clear .venv-dist
	.venv-dist/bin/python $(PIP) build twine
	rm -rf dist
	.venv-dist/bin/python -m build --quiet
	.venv-dist/bin/twine check --strict dist/*

clean:
	rm -rf .venv .venv-* $(OUT) build dist .coverage .coverage.* htmlcov
	rm -rf .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests benchmarks docs graphs -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

# Each environment holds empty files `python`, `run` and `dev`: how far its set-up has come. The
# build tools come first and pinned, so that building the package fetches nothing else.
ENVIRONMENTS := $(VENV) $(SUPPORTED:%=.venv-%) .venv-lowest .venv-plain
VERSIONS = $(patsubst .venv-%,%,$(filter-out $(VENV) .venv-plain,$(@D)))
RUN_PINS = requirements/run.txt
CONSTRAINTS = -c requirements/build.txt -c $(RUN_PINS) -c requirements/dev.txt
.venv-lowest/%: VERSIONS = $(SUPPORTED)
.venv-lowest/%: RUN_PINS = requirements/lowest.txt

$(ENVIRONMENTS:%=%/python): requirements/build.txt
	@python="$(if $(filter $(VENV),$(@D)),$(PYTHON))"; [ -n "$$python" ] || python=$$(sh .ci/find-python $(VERSIONS)) || \
		{ echo "lab3 $(NO_PYTHON)" >&2; exit 1; }; \
	echo "$$python -m venv $(@D)"; "$$python" -I -m venv --clear $(@D)
	$(@D)/bin/python $(PIP) -r $<
	@touch $@

$(ENVIRONMENTS:%=%/run): %/run: %/python $(PINS) pyproject.toml
	$(@D)/bin/python $(PIP) --no-build-isolation $(CONSTRAINTS) -e .
	@touch $@

$(ENVIRONMENTS:%=%/dev): %/dev: %/python $(PINS) pyproject.toml
	$(@D)/bin/python $(PIP) --no-build-isolation $(CONSTRAINTS) -e '.[test]'
	$(@D)/bin/python $(PIP) --no-deps -r requirements/schemas.txt
	@touch $(@D)/run $@
