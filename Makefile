# Everything a newcomer or CI needs. Each target sets up what is missing first; when nothing is, that costs milliseconds.

PYTHON := .venv/bin/python
export OMP_NUM_THREADS := 1
# processes that share the test files; the tests under mpirun start more
WORKERS ?= 2
# sample of 'make mutants'
SEED ?= 1
N ?= 100
# Open MPI refuses root and more ranks than cores unless told otherwise, and ranks that wait take a core; the tests do all.
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
export OMPI_MCA_rmaps_base_oversubscribe := 1
export OMPI_MCA_mpi_yield_when_idle := 1
export MPIR_CVAR_ENABLE_HEAVY_YIELD := 1
export PRTE_MCA_rmaps_default_mapping_policy := :oversubscribe

.PHONY: demo test test-slow test-paper test-trixie test-wheels dist lint format bench bench-page bench-peers numbers golden mutants docs \
  pictures linkcheck setup clean

demo: .venv/.ready ## solve the box; show gap, picture and where the report is
	$(PYTHON) demos/demo_box.py

test: .venv/.ready ## unit tests, MPI on 1 to 4 ranks, demos --quick
	$(PYTHON) -m pytest -m "not slow and not paper" -n $(WORKERS) --dist loadfile --no-loadscope-reorder

test-slow: .venv/.ready ## longer checks
	$(PYTHON) -m pytest -m slow

test-paper: .venv/.ready ## figures of the paper
	$(PYTHON) -m pytest -m paper

test-trixie: ## demo, docs and all tests on Debian 13 with dolfinx 0.9, in a chroot; needs root, and time
	./scripts/test-trixie.sh

test-wheels: ## first steps, package, demo, docs and all tests from wheels, as a user of a bare Debian 13; needs root, and time
	./scripts/test-wheels.sh

dist: .venv/.ready ## wheel and sdist into build/dist, checked, installed elsewhere and used there
	./scripts/dist.sh

lint: .venv/.ready ## style and types
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

format: .venv/.ready
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

bench: .venv/.ready ## speed against dolfinx, flop rates, time to a gap, phases, growth, start-up; ten minutes, one core
	$(PYTHON) benchmarks/run_all.py

bench-page: .venv/.ready ## put the figures of 'make bench' and 'make bench-peers' into docs
	$(PYTHON) benchmarks/performance_page.py

bench-peers: .venv/.ready ## the same problems in FElupe, NGSolve and dolfinx, set up in runs/peers-env; ten minutes, one core
	$(PYTHON) benchmarks/peer_runs.py

numbers: .venv/.ready ## all numbers of results in README and docs anew from runs; what was measured is kept in runs
	scripts/refresh-numbers

golden: .venv/.ready ## write the golden C files, and what pictures consist of, anew
	$(PYTHON) tests/golden/update.py

mutants: .venv/.ready ## N small faults in the sources, each against the tests near it; an hour, docs/mutation.md
	scripts/mutants --seed $(SEED) --number $(N) --workers $(WORKERS)

docs: .venv/.ready ## the site into build/docs/html; a warning is an error
	.venv/bin/sphinx-build -q -W --keep-going -d build/docs/cache -b html docs build/docs/html

pictures: .venv/.ready ## the documentation's pictures anew; some minutes
	scripts/make-pictures

linkcheck: .venv/.ready ## links to other sites; needs the network; fails if one is broken, build/docs/links/output.txt
	.venv/bin/sphinx-build -q -d build/docs/cache -b linkcheck docs build/docs/links

setup: .venv/.ready

.venv/.ready: pyproject.toml scripts/setup.sh scripts/debian-packages.txt
	./scripts/setup.sh

clean:
	rm -rf .venv build runs .pytest_cache .mypy_cache .ruff_cache *.egg-info
