# make       sets up .venv where that is needed, then runs the pipeline
# make test  sets up .venv where that is needed, then runs the tests
CORES ?= 2
LOCKS ?= requirements.lock
PYTHON ?= $(shell command -v python3.11 || command -v python3 || command -v python)
BIN := .venv/bin
READY := .venv/.ready
# The package has no hash, so it is installed by itself, built with the locked setuptools.
ITSELF := --no-deps --no-build-isolation -e .
QUIET := --quiet --disable-pip-version-check
LOCK := uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet

# Every job is a process of its own: without byte code each of them would compile its imports again.
export PYTHONDONTWRITEBYTECODE :=
export UV_COMPILE_BYTECODE := 1

.PHONY: all setup test lock clean

all: $(READY)
	$(BIN)/snakemake --cores $(CORES)

setup: $(READY)

test: $(READY)
	$(BIN)/pytest -n $(CORES) --no-loadscope-reorder

# The stamp goes first and comes last: a set-up that was interrupted is done again from nothing.
$(READY): $(LOCKS) pyproject.toml
	@if [ ! -e $@ ]; then rm -rf .venv; fi; rm -f $@
	@if command -v uv >/dev/null 2>&1; then \
		echo "Setting up .venv with uv ..." && \
		{ [ -d .venv ] || uv venv --quiet --python '>=3.11' .venv; } && \
		for lock in $(LOCKS); do uv pip install --quiet --python $(BIN)/python --require-hashes -r $$lock || exit 1; done && \
		uv pip install --quiet --python $(BIN)/python $(ITSELF); \
	elif [ -n "$(PYTHON)" ] && "$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then \
		echo "Setting up .venv with pip ..." && \
		{ [ -d .venv ] || "$(PYTHON)" -m venv .venv; } && \
		for lock in $(LOCKS); do $(BIN)/python -m pip install $(QUIET) --require-hashes -r $$lock || exit 1; done && \
		$(BIN)/python -m pip install $(QUIET) $(ITSELF); \
	else \
		echo "fusetune needs Python 3.11 or newer, or uv: install one of them and run make again." >&2; exit 1; \
	fi
	@touch $@

# Writes the lock files anew, keeping their versions where they still fit; `make lock UPGRADE=--upgrade` takes the newest.
lock:
	$(LOCK) $(UPGRADE) --extra test --extra dev --output-file requirements.lock
	$(LOCK) $(UPGRADE) --extra slurm --constraint requirements.lock --output-file requirements-slurm.lock

# Removes what the pipeline has made; logs in flights/ and the environment stay.
clean:
	rm -rf results .snakemake .cache
