# make demo, make test, make docs: each does all the set-up and then runs. PYTHON chooses the interpreter.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# The package alone, without PyTorch and development tools.
PLAIN_READY := .venv-demo/.ready
AUDIT_READY := .venv-audit/.ready

.PHONY: install install-plain demo test lint docs audit fuzz hosts mutation toolkit clean

install: $(READY)

install-plain: $(PLAIN_READY)

$(READY): EXTRAS := [dev]

$(READY) $(PLAIN_READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
		|| { echo "ssiam needs Python 3.10 or newer; try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/python -m pip install --quiet --upgrade pip
	$(@D)/bin/python -m pip install --quiet --no-compile --editable '.$(EXTRAS)'
	@touch $@

demo: $(PLAIN_READY)
	@.venv-demo/bin/python examples/demo.py

test: $(READY)
	OMP_WAIT_POLICY=PASSIVE $(BIN)/python -m pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(READY)
	$(BIN)/mkdocs build --strict --quiet

$(AUDIT_READY):
	$(PYTHON) -m venv $(@D)
	@$(@D)/bin/python -m pip install --quiet pip-audit \
		|| { echo "audit: not done: pip-audit cannot be installed; is the network reachable?"; exit 2; }
	@touch $@

audit: $(READY) $(AUDIT_READY)
	@.venv-audit/bin/python scripts/audit.py \
		"$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')"

# Minutes of damaged inputs: make fuzz MINUTES=30
MINUTES ?= 10
fuzz: $(READY)
	OMP_WAIT_POLICY=PASSIVE $(BIN)/python scripts/fuzz.py $(MINUTES)

# The adapters of ssiam.integrations in the real packages, each in an environment of its own.
hosts: $(READY)
	$(BIN)/python scripts/hosts.py $(HOSTS)

mutation: $(READY)
	$(BIN)/python scripts/mutation_sample.py

toolkit: $(READY)
	$(BIN)/python scripts/official_toolkit.py

clean:
	rm -rf .venv .venv-audit .venv-demo demo-out site
