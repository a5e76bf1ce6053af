# make setup | demo | check | test | coverage | lint | docs. Where ROS 2 is sourced it is used; elsewhere its wheels from PyPI go into .venv.
SHELL := bash
.DELETE_ON_ERROR:
PYTHON ?= python3
HAS_ROS := $(shell test -n "$$ROS_DISTRO" && $(PYTHON) -c 'import rclpy' 2>/dev/null && echo yes)
VENV := $(if $(HAS_ROS),.venv-ros,.venv)
OUT ?= out/demo
# nproc would take OMP_NUM_THREADS for the number of cores.
JOBS ?= $(shell env -u OMP_NUM_THREADS nproc)
# Tests start some hundred processes: where Python may keep no bytecode, each would translate every module again.
unexport PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX ?= $(CURDIR)/out/bytecode

.PHONY: setup demo check test coverage lint docs pictures clean

setup: $(VENV)/.complete

$(VENV)/.complete: setup.py tools/setup_environment
	@PYTHON='$(PYTHON)' bash tools/setup_environment $(VENV) $(HAS_ROS)
	@touch $@

demo: setup
	$(VENV)/bin/sgms demo --out $(OUT) --overwrite

# The inner loop: about a minute.
check: lint
	$(VENV)/bin/sgms compile
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(VENV)/bin/python -m pytest --quick -q --numprocesses $(JOBS) --dist loadfile --no-loadscope-reorder $(PYTEST_ARGS)

test: setup
	@tools/run_tests $(VENV)/bin/python $(JOBS) $(PYTEST_ARGS)

# Every Python that the tests start counts its lines. Tests of time may fail: counting costs time.
coverage: setup
	@rm -rf out/coverage && mkdir -p out/coverage
	-COVERAGE_PROCESS_START=$(CURDIR)/pyproject.toml COVERAGE_FILE=$(CURDIR)/out/coverage/data \
	  tools/run_tests $(VENV)/bin/python $(JOBS) $(PYTEST_ARGS)
	cd out/coverage && ../../$(VENV)/bin/python -m coverage combine -q --rcfile ../../pyproject.toml --data-file data
	$(VENV)/bin/python -m coverage html -q --data-file out/coverage/data --directory out/coverage/html
	$(VENV)/bin/python -m coverage report --data-file out/coverage/data

lint: setup
	$(VENV)/bin/python -m ruff check .
	$(VENV)/bin/python -m mypy

# The same pages as HTML, readable without a network: out/site/index.html.
docs: setup
	$(VENV)/bin/python -m mkdocs build --strict --site-dir out/site

# The pictures of README and docs, from a run of the demonstration.
pictures: demo
	cp $(OUT)/x_without_friction.png docs/images/friction.png
	cp $(OUT)/x_tracking.png docs/images/tracking.png

clean:
	rm -rf .venv .venv-ros .venv-noble build install log out *.egg-info
