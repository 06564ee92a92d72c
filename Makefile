# make walk: set up everything, then let Ranger walk 100 steps.   make test: set up everything, then run all tests.
# make test-vm: the tests on real SocketCAN, in a virtual machine where this kernel has none (tools/vm/README.md).
PYTHON ?= python3
VENV   ?= .venv
STEPS  ?= 100
RUN    := $(VENV)/bin/python
SOURCES := $(shell find ranger_sim foundation datatable can_bus plant firmware_sim boards harness tools \( -name '*.py' -o -name '*.pxd' \) -not -name '_*' 2>/dev/null)

.PHONY: walk test test-vm lint setup bench lock clean

walk: $(VENV)/.built
	$(RUN) -m ranger_sim walk --steps $(STEPS) --out runs/walk

test: $(VENV)/.built
	$(RUN) -m pytest -q -rs

test-vm: $(VENV)/.built
	$(RUN) -m tests.vm.run

lint: $(VENV)/.built
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check --quiet .
	$(RUN) -m mypy

bench: $(VENV)/.built
	$(RUN) -m ranger_sim bench

setup: $(VENV)/.built

# Dependencies are locked with hashes and without index addresses: the machine's own pip settings say where from.
$(VENV)/.installed: requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "ranger-sim needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; try make PYTHON=python3.12")'
	@echo "Setting up $(VENV) (once) ..."
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@touch $@

# Compiled where a C compiler is found, interpreted otherwise (told, with the reason); only changed modules are rebuilt.
# Installing it as editable would build everything a second time, in a folder of its own: RANGER_SIM_BUILT=1 stops that.
# It is linked again when pyproject.toml changes: the commands and python-can's entry point are found through it.
$(VENV)/.built: $(VENV)/.installed pyproject.toml setup.py $(SOURCES)
	@echo "Building (compiled where a C compiler is found; the first time takes some minutes) ..."
	@$(RUN) setup.py -q build_ext --inplace
	@test -f $(VENV)/.linked -a ! pyproject.toml -nt $(VENV)/.linked || RANGER_SIM_BUILT=1 $(RUN) -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $(VENV)/.linked $@

lock:
	uv pip compile pyproject.toml --extra dev --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 -o requirements.lock

clean:
	rm -rf $(VENV) build *.egg-info
	find . -name '*.so' -not -path './$(VENV)/*' -delete
	find . -name '*.c' -not -path './$(VENV)/*' -not -path './datatable/generated/*' -delete
	rm -f ranger_sim/build_record.json
