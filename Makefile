# make walk: set up everything, then let Ranger walk 100 steps.   make test: set up everything, then run all tests.
# make test-interpreted: the packages' own tests on the plain sources, where compiled modules run in `make test`; and nine
#   scenarios compiled and interpreted, to the byte.
# make docs: the documentation as a site, and every command and program of its tutorial and how-to pages run; then
#   README and tutorial in order, in an environment that only their commands make.
# make test-blind: the diagnosis on fresh cases with hidden effects, against bounds.
# make test-suites: other projects' CAN tests on our buses, and our tests that need other people's libraries.
# make test-vm: the tests on real SocketCAN, in a virtual machine where this kernel has none (dev/vm/README.md).
PYTHON ?= python3
VENV   ?= .venv
STEPS  ?= 100
RUN    := $(VENV)/bin/python
# What pytest makes of a file is kept for the next run, also where Python is set to write no bytecode.
PYTEST := PYTHONDONTWRITEBYTECODE= $(RUN) -m pytest -q
SOURCES := $(shell find -L ranger_sim \( -name '*.py' -o -name '*.pxd' \) -not -name '_*' 2>/dev/null) dev/declarations.py

.PHONY: walk test test-interpreted test-blind test-suites test-vm docs lint setup bench lock clean

walk: $(VENV)/.walk
	$(RUN) -m ranger_sim walk --steps $(STEPS) --out runs/walk
	@echo
	@echo "next ('. $(VENV)/bin/activate' makes it ranger-sim without the path):"
	@echo "    $(VENV)/bin/ranger-sim panel --walk    # Ranger walks, in your browser"
	@echo "    $(VENV)/bin/ranger-sim walk --fault 'MCH.joint_encoder:stuck@step 6' --out runs/fault    # with a fault"
	@echo "    $(VENV)/bin/ranger-sim new my-machine    # boards in C, a bus and a body of your own, with tests"

# Tests of a robot at a pace of the wall clock. A page that follows one leaves out what it is too slow for, and its
# comparison gives way to everything else: those of pages have both cores to themselves. The others promise no pace, and
# go side by side with the rest.
WITH_A_CLOCK = tests/system/test_attached_clients.py tests/system/test_processes.py \
	tests/tools/run/test_up_view.py tests/tools/panel/test_page.py tests/tools/panel/test_live.py \
	tests/tools/panel/test_reader.py tests/tools/panel/test_comparison.py tests/test_watched.py tests/vm
ALONE = $(filter tests/tools/panel/% tests/test_watched.py,$(WITH_A_CLOCK))
# Run by `make docs`.
PAGES = tests/pages

test: $(VENV)/.all
	$(PYTEST) -rsfE -n 2 --dist loadfile --no-loadscope-reorder -m "not both_ways and not blind" $(addprefix --ignore=,$(ALONE) $(PAGES))
	$(PYTEST) -rsfE $(ALONE)

# The packages' own tests interpreted: what is compiled must be right as plain Python, too. Left out are walks, which take
# minutes so, programs that keep a pace, and what compares both modes already.
PLAIN = $(addprefix tests/,foundation datatable can_bus firmware_sim boards plant ranger/test_counters.py \
	harness/test_imu_wire.py harness/test_profile.py ranger/test_requests.py harness/test_supervision.py)
NOT_PLAIN = $(addprefix tests/,can_bus/test_can_programs.py boards/test_head_2015.py boards/test_original_images.py \
	boards/test_main_brain_runs_alike_compiled_and_interpreted.py plant/walking/test_walking.py)

test-interpreted: $(VENV)/.all
	RANGER_SIM_INTERPRETED=1 $(PYTEST) -rsfE -n 2 --dist loadfile --no-loadscope-reorder $(addprefix --ignore=,$(NOT_PLAIN)) $(PLAIN)
	$(PYTEST) -rsfE -n 2 -m both_ways tests/system/test_determinism.py

docs: $(VENV)/.all
	$(RUN) -m sphinx -W --keep-going -q -b html -c docs . build/site
	$(PYTEST) -n 2 $(PAGES)
	$(RUN) -m dev.readme
	@echo "build/site/docs/index.html"

test-blind: $(VENV)/.all
	$(PYTEST) -rsfE -m blind tests/blind

test-suites: $(VENV)/.all
	$(RUN) -m dev.suites

test-vm: $(VENV)/.all
	env -u CI $(RUN) -m tests.vm.run # what its guest has is its own affair

lint: $(VENV)/.tools
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check --quiet .
	rm -rf build/typed
	@mkdir -p build && CC=false $(RUN) setup.py -q build_py --build-lib build/typed 2>build/typed.log || (cat build/typed.log; false)
	$(RUN) -m mypy --num-workers 2

bench: $(VENV)/.walk
	$(RUN) -m ranger_sim bench

setup: $(VENV)/.all

# Once: the environment, packages (locked with hashes, without index addresses: the machine's own pip settings say where
# from) and the library; then only what changed. set_up.py says how. Commands need fewer packages than the tests do.
$(VENV)/.walk: set_up.py requirements.lock pyproject.toml setup.py $(SOURCES)
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "ranger-sim needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; try make PYTHON=python3.12")'
	@$(PYTHON) set_up.py walk --venv $(VENV)
	@touch $@

$(VENV)/.tools: set_up.py requirements.lock pyproject.toml
	@$(PYTHON) set_up.py lint --venv $(VENV)
	@touch $@

$(VENV)/.all: $(VENV)/.walk
	@$(PYTHON) set_up.py all --venv $(VENV)
	@touch $@

lock:
	uv pip compile pyproject.toml --all-extras --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 -o requirements.lock

clean:
	rm -rf $(VENV) build *.egg-info
	find . -name '*.so' -not -path './$(VENV)/*' -delete
