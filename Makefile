# Two commands set everything up by themselves: make demo, make test.

PYTHON ?= python3
VENV ?= .venv
UBUNTU_VENV ?= .venv-ubuntu-24.04
PIP_FLAGS ?= --quiet --disable-pip-version-check

# A sourced ROS installation must not leak in: the environment brings its own, complete and of known versions.
unexport PYTHONPATH PYTHONHOME PYTHONSTARTUP VIRTUAL_ENV LD_LIBRARY_PATH LD_PRELOAD AMENT_PREFIX_PATH AMENT_CURRENT_PREFIX \
	AMENT_PYTHON_EXECUTABLE _ROS_WHEELS_BOOTSTRAP_COMPLETE CMAKE_PREFIX_PATH COLCON_PREFIX_PATH COLCON_PYTHON_EXECUTABLE COLCON_CURRENT_PREFIX
unexport $(filter ROS_% RMW_% RCUTILS_% RCL_% FASTRTPS_% FASTDDS_% CYCLONEDDS_%,$(.VARIABLES))

# Tests run beside each other, one process a core; those that start processes themselves one after the other.
BESIDE = -n auto

PACKAGE = setup.py setup.cfg pyproject.toml package.xml
RUN = $(VENV)/.installed-run
DEV = $(VENV)/.installed-dev
UBUNTU = $(UBUNTU_VENV)/.installed

.PHONY: help demo test test-ubuntu soak starts fuzz lint format screenshots config lock clean
help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 14

# What it writes is its own, so a second run replaces it.
demo: $(RUN) ## the whole system, live, on the bundled recording; writes demo_output/
	$(VENV)/bin/lasso-motion demo --overwrite $(ARGS)

test: $(DEV) ## all tests, with real ROS processes
	$(VENV)/bin/python -m pytest $(BESIDE) $(ARGS)

test-ubuntu: $(UBUNTU) ## the quicker tests that need no ROS, with the library versions of Ubuntu 24.04
	$(UBUNTU_VENV)/bin/python -m pytest $(BESIDE) -m "not ros and not packaging and not slow" $(ARGS)

soak: $(RUN) ## 20,000 pairs through a live tracker: memory, threads and files must not grow (ten minutes)
	$(VENV)/bin/python -m lasso_motion_ros.bench.soak $(ARGS)

starts: $(RUN) ## tracker and player started 20 times as a user does, and 40 times under use_sim_time (eight minutes)
	$(VENV)/bin/python -m lasso_motion_ros.bench.starts $(ARGS)

fuzz: $(DEV) ## 100,000 spoilt messages, files and recordings: clear errors only, no hang, no memory blow-up (ten minutes)
	PYTHONPATH=test $(VENV)/bin/python test/support/fuzz.py $(ARGS)

lint: $(DEV) ## formatting, style and types
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy

format: $(DEV) ## put the formatting right
	$(VENV)/bin/ruff format .
	$(VENV)/bin/ruff check --fix .

screenshots: $(DEV) ## the pictures in docs/, for the README; needs Chromium
	$(VENV)/bin/python docs/screenshots.py
	$(VENV)/bin/python docs/screenshot_web.py

config: $(RUN) ## write config/*.yaml and docs/parameters.md from the parameter table
	$(VENV)/bin/python -m lasso_motion_ros.config.parameter_files

lock: $(DEV) ## resolve the locked requirements anew
	$(VENV)/bin/python requirements/lock.py

clean: ## remove environments and outputs
	rm -rf $(VENV) $(UBUNTU_VENV) demo_output build install log .pytest_cache .mypy_cache .ruff_cache

$(VENV)/bin/python:
	@$(call make_environment,$(VENV))

# Editable, so that a second run starts at once whatever was changed in between.
$(RUN): requirements/run.txt $(PACKAGE) | $(VENV)/bin/python
	@echo "Installing what the demo needs into $(VENV) (a minute or two, once)"
	@$(VENV)/bin/python -m pip install $(PIP_FLAGS) -r requirements/run.txt
	@$(VENV)/bin/python -m pip install $(PIP_FLAGS) --no-deps --no-build-isolation --editable .
	@touch $@

$(DEV): requirements/dev.txt $(RUN)
	@echo "Installing what the tests need into $(VENV)"
	@$(VENV)/bin/python -m pip install $(PIP_FLAGS) -r requirements/dev.txt
	@touch $@

$(UBUNTU): requirements/ubuntu-24.04.txt $(PACKAGE)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info >= (3, 13))' \
		|| { echo "make: these versions need Python 3.11 or 3.12: make test-ubuntu PYTHON=python3.12"; exit 2; }
	@$(call make_environment,$(UBUNTU_VENV))
	@echo "Installing Ubuntu 24.04's versions into $(UBUNTU_VENV)"
	@$(UBUNTU_VENV)/bin/python -m pip install $(PIP_FLAGS) -r requirements/ubuntu-24.04.txt
	@$(UBUNTU_VENV)/bin/python -m pip install $(PIP_FLAGS) --no-deps --no-build-isolation --editable .
	@touch $@

define make_environment
	command -v $(PYTHON) >/dev/null || { echo "make: no $(PYTHON) here; name one: make PYTHON=python3.12 …"; exit 2; }; \
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "make: Python 3.11 or later is needed, $$($(PYTHON) --version) found; make PYTHON=python3.12 …"; exit 2; }; \
	$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
		|| { echo "make: $(PYTHON) has no venv module; on Debian and Ubuntu: sudo apt install python3-venv"; exit 2; }; \
	$(PYTHON) -m venv $(1)
endef
