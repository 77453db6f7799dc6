# Every target makes the environment it needs: `make demo` works on a machine with Python, make and git.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY_FOR_DEMO := $(VENV)/.ready-for-demo
READY := $(VENV)/.ready
READY_FOR_DOCS := $(VENV)/.ready-for-docs
READY_FOR_DIST := $(VENV)/.ready-for-dist

# With bytecode on disk, each of the many processes that tests start takes 0.2 s less.
export PYTHONDONTWRITEBYTECODE =

.PHONY: help demo test test-all test-long fuzz check docs dist coverage compatibility mutations format bench soak smoke \
	paper state-of-the-art baselines clean

help:
	@echo "make demo    plan the art museum and write tables and pictures to results/demo/"
	@echo "make test    the tests that find faults soon: some two minutes"
	@echo "make test-all  make test and the slow ones: processes, Dask, a browser, LaTeX, guides that run"
	@echo "make test-long  the property tests with twenty times the examples that they state: an hour"
	@echo "make fuzz    mission files, solutions and bounds changed at random, 100 000 of each form: two hours"
	@echo "make check   ruff (lint and format), mypy strict, and who imports whom"
	@echo "make docs    the documentation, in docs/_build/html"
	@echo "make dist    wheel and sdist, in dist/, and tests of them where they are installed: five minutes"
	@echo "make coverage  the share of lines and branches that tests run, kernels uncompiled"
	@echo "make compatibility  the tests with the oldest and the newest libraries, on each Python that is here"
	@echo "make mutations  does make test notice a changed operator, in two hundred places?"
	@echo "make bench   the numbers this project claims"
	@echo "make soak    a study of many small runs for an hour: memory has to stay flat"
	@echo "make smoke   a study of seconds, with its report"
	@echo "make paper   the paper's study, with its report, beside what was published"
	@echo "make state-of-the-art  Pareto local search beside BO-ACO and its variants: half an hour"
	@echo "make baselines  BO-ACO and the baselines, ten seeds on four missions: an hour"

# pip is silent while it installs and, where its output is no terminal, while it downloads.
define install
@echo 'pip install $(1)'
@(while sleep 6 >/dev/null && kill -0 $$$$; do echo "... $$(du -sh $(VENV) | cut -f 1) in $(VENV)"; done) 2>/dev/null & \
	beat=$$!; $(BIN)/python -m pip install --constraint constraints.txt $(1); status=$$?; kill $$beat; exit $$status
endef

# Bytecode is made of what is imported when it is imported: to make it of everything takes two minutes.
$(READY_FOR_DEMO): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	@echo "installing some 600 MB: half a minute where the network is fast"
	$(call install,--no-compile --editable .)
	@touch $@

$(READY): $(READY_FOR_DEMO)
	$(call install,--quiet --no-compile --editable ".[dev]")
	@touch $@

$(READY_FOR_DOCS): $(READY)
	$(call install,--quiet --no-compile --editable ".[docs]")
	@touch $@

$(READY_FOR_DIST): $(READY)
	$(call install,--quiet --editable ".[dist]")
	@touch $@

demo: $(READY_FOR_DEMO)
	$(BIN)/botohe solve art_museum --evaluations 1000000 --seed 1 --out results/demo

PYTEST := $(BIN)/python -m pytest --numprocesses 2 --maxprocesses 2 --dist worksteal

test: $(READY)
	BOTOHE_EXAMPLES=0.1 $(PYTEST) -m "not slow"

# Properties get more examples where they are slow alone: `make test-long` has many for all of them.
test-all: test
	BOTOHE_EXAMPLES=0.3 $(PYTEST) -m slow

test-long: $(READY)
	BOTOHE_EXAMPLES=20 BOTOHE_MUTATIONS=1000 $(PYTEST) -m "hypothesis or seeds" --timeout 3600

# The tests that are marked state 200 examples each.
fuzz: $(READY)
	BOTOHE_EXAMPLES=500 $(PYTEST) -m fuzz --timeout 3600

check: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

# Warnings and references that lead nowhere are errors; nothing is read from a network.
docs: $(READY_FOR_DOCS)
	rm -rf docs/_build docs/reference/names
	$(BIN)/python -m sphinx --builder html --nitpicky --fail-on-warning --keep-going --quiet docs docs/_build/html
	$(BIN)/python -m pytest docs/test_built.py

# The wheel is built from the sdist. The tests are not among those of `make test`: they take minutes.
dist: $(READY_FOR_DIST)
	rm -rf dist
	$(BIN)/python -m build --no-isolation
	$(BIN)/python -m pytest checks/test_packaging.py checks/test_dist.py

# Kernels run uncompiled for lines to be seen in them; the other tests take too long without compiled ones.
COVERED_UNCOMPILED := tests/core tests/operators tests/outcomes tests/bounds/test_kernels.py \
	$(addprefix tests/algorithms/, annealing/test_kernels.py bo_aco/test_kernels.py exact/test_kernels.py \
	greedy/test_kernels.py) \
	$(addprefix tests/algorithms/local_search/test_, recreate.py search.py state.py)
COVERED := $(subst -m pytest,-m coverage run -m pytest,$(PYTEST))
coverage: $(READY)
	$(BIN)/python -m coverage erase
	NUMBA_DISABLE_JIT=1 $(COVERED) -m "not compiled_only" $(COVERED_UNCOMPILED)
	$(COVERED)
	$(BIN)/python -m coverage combine --quiet
	$(BIN)/python -m coverage report

compatibility: $(READY)
	$(BIN)/python -m checks.compatibility --out results/compatibility/compatibility.csv

mutations: $(READY)
	$(BIN)/python -m checks.mutations --out results/mutations/mutations.csv

format: $(READY)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: $(READY)
	$(BIN)/python -m benchmarks

soak: $(READY)
	$(BIN)/python -m benchmarks.soak

smoke baselines: $(READY)
	$(BIN)/botohe study run experiments/$@.yaml
	$(BIN)/botohe study report results/$@

state-of-the-art: $(READY)
	$(BIN)/botohe study run experiments/state-of-the-art.yaml
	$(BIN)/botohe study report results/state-of-the-art
	$(BIN)/botohe study run experiments/state-of-the-art-seconds.yaml
	$(BIN)/botohe study report results/state-of-the-art-seconds

paper: $(READY)
	$(BIN)/botohe study run experiments/paper.yaml
	$(BIN)/botohe study run experiments/annealing.yaml
	$(BIN)/botohe study report results/paper
	$(BIN)/python -m benchmarks paper

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache dist .coverage .coverage.* results/demo results/bench \
		docs/_build docs/reference/names
	find . -name __pycache__ -prune -exec rm -rf {} +
