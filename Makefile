# make                sets up .venv where that is needed, then runs the pipeline
# make demonstration  … then looks whether it made all, found what is wrong with its vehicle, and would do nothing twice
# make demo-loop      … then closes the loop once on a simulated vehicle: design, fly, study, apply, fly again, confirmed
# make test           adds to .venv what development needs, where that is missing, then runs the tests
# make browser        … then looks at the pages in Chromium, as a reader does, and judges them by axe-core
# make lint           … then looks for slips, form, and imports that the house forbids
# make types          … then checks the types
# make wheel          builds a wheel into dist/; on Linux with an x86-64 processor it carries the estimator compiled
# make docs           … then builds the documentation into site/, its notebooks run on the demonstration's flights
# make with-upload    adds to .venv what requirements-upload.lock holds; likewise with-slurm, with-mlflow, with-browser, with-dev
# These are the checks of a change; .ci/run and .github/workflows/checks.yml call them.
CORES ?= 2
PYTHON ?= $(shell command -v python3.11 || command -v python3 || command -v python)
# A Python that is asked for is the one of .venv; otherwise uv may choose, and fetch, any that serves.
UV_PYTHON := $(if $(filter environment command,$(firstword $(origin PYTHON))),$(PYTHON),>=3.11)
BIN := .venv/bin
READY := .venv/.ready
DEVELOPMENT := .venv/.with-dev
# A lock is complete, so nothing is left to be resolved. Byte code, without which each job would compile its imports again,
# is made by all cores at the end: pip and uv would make it of the libraries' tests, too, and pip on one core.
LOCKED := --quiet --no-deps --require-hashes
# The package has no hash, so it is installed by itself, built with the locked setuptools.
ITSELF := --quiet --no-deps --no-build-isolation -e .
WITH_UV := uv pip install --no-compile --python $(BIN)/python
WITH_PIP := $(BIN)/python -m pip --disable-pip-version-check install --no-compile
# Few runs import scikit-learn, and matplotlib uses fontTools for formats that nothing here writes.
BYTE_CODE := $(BIN)/python -m compileall -qq -j0 -x '/(tests?|sklearn|fontTools)/' .venv/lib
LOCK := uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet

export PYTHONDONTWRITEBYTECODE :=
unexport UV_COMPILE_BYTECODE

# What the demonstration is for; with real logs the same files come.
MADE := results/apply/best_params.params results/apply/rollback.params results/apply/decision.json results/report.html

.PHONY: all setup test browser lint types demonstration demo-loop docs wheel lock clean

all: $(READY)
	$(BIN)/snakemake --cores $(CORES)

setup: $(READY)

with-%: .venv/.with-% ;

test: $(DEVELOPMENT)
	$(BIN)/pytest -n $(CORES) --no-loadscope-reorder

# Chromium and npm are the system's. Where they cannot be had the tests that need them are skipped, saying so.
browser: $(DEVELOPMENT) .venv/.with-browser
	@if ! { command -v chromium || command -v chromium-browser || command -v google-chrome; } >/dev/null; then \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "Installing Chromium ..."; apt-get update -qq && \
			apt-get install -qq --no-install-recommends chromium fonts-dejavu-core >/dev/null; \
		else \
			echo "There is no Chromium: install the package chromium (or Google Chrome) and run make browser again." >&2; \
		fi; \
	fi
	@if command -v npm >/dev/null; then \
		cd tests/browser && npm ci --ignore-scripts --no-audit --no-fund --silent; \
	else \
		echo "There is no npm: install Node.js, and accessibility is judged, too." >&2; \
	fi
	$(BIN)/pytest tests/browser

lint: $(DEVELOPMENT)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check workflow
	$(BIN)/snakemake --lint
	$(BIN)/lint-imports

types: $(DEVELOPMENT)
	$(BIN)/mypy

demonstration: all
	@for file in $(MADE); do [ -s "$$file" ] || { echo "$$file is missing or empty" >&2; exit 1; }; done
	@[ -n "$$(find -L flights -name '*.ulg')" ] || grep -q "It confirms the change" results/report.html || \
		{ echo "no change that the truth confirms" >&2; exit 1; }
	@[ -n "$$(find -L flights -name '*.ulg')" ] || for name in EKF2_GPS_DELAY EKF2_ACC_NOISE EKF2_GYR_NOISE; do \
		grep -q "$$name" results/apply/best_params.params || { echo "$$name is left wrong" >&2; exit 1; }; \
	done
	@$(BIN)/snakemake --cores 1 --dry-run | grep -q "Nothing to be done" || { echo "a second run would not be idle" >&2; exit 1; }

# Fails where a link leads nowhere, a docstring cannot be read, or a cell of a notebook fails.
docs: .venv/.with-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

demo-loop: $(READY)
	$(BIN)/python -m benchmarks.closed_loop --cores $(CORES)

# From an empty build/, which might hold what is no more. Kernels are compiled for processors that have AVX2.
wheel: $(READY)
	rm -rf build dist
	FUSETUNE_KERNELS=$$([ "$$(uname -sm)" = "Linux x86_64" ] && grep -q avx2 /proc/cpuinfo && echo 1) \
		$(BIN)/python -c "from setuptools import build_meta; print('dist/' + build_meta.build_wheel('dist'))"

# The stamp goes first and comes last: a set-up that was interrupted is done again from nothing. Libraries in which Python
# finds no byte code are as good.
$(READY): requirements.lock pyproject.toml
	@if [ ! -e $@ ]; then rm -rf .venv; fi; rm -f $@
	@if command -v uv >/dev/null 2>&1; then \
		echo "Setting up .venv with uv ..." && \
		{ [ -d .venv ] || uv venv --quiet --python '$(UV_PYTHON)' .venv; } && \
		$(WITH_UV) $(LOCKED) -r requirements.lock && $(WITH_UV) $(ITSELF); \
	elif [ -n "$(PYTHON)" ] && "$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then \
		echo "Setting up .venv with pip ..." && \
		{ [ -d .venv ] || "$(PYTHON)" -m venv .venv; } && \
		$(WITH_PIP) $(LOCKED) -r requirements.lock && $(WITH_PIP) $(ITSELF); \
	else \
		echo "fusetune needs Python 3.11 or newer, or uv: install one of them and run make again." >&2; exit 1; \
	fi
	@$(BYTE_CODE) || true
	@touch $@

# Here the stamp of .venv steps aside, so that it keeps its time; where nothing can be fetched .venv stays as it was.
.PRECIOUS: .venv/.with-%
.venv/.with-%: requirements-%.lock $(READY)
	@echo "Adding $< to .venv ..."; mv $(READY) .venv/.changing
	@if command -v uv >/dev/null 2>&1; then $(WITH_UV) $(LOCKED) -r $<; else $(WITH_PIP) $(LOCKED) -r $<; fi || \
		{ mv .venv/.changing $(READY); exit 1; }
	@$(BYTE_CODE) || true
	@mv .venv/.changing $(READY); touch $@

# Writes the lock files anew, keeping their versions where they still fit; `make lock UPGRADE=--upgrade` takes the newest.
lock:
	$(LOCK) $(UPGRADE) --extra build --extra test --extra dev --output-file requirements-dev.lock
	$(LOCK) $(UPGRADE) --extra build --constraint requirements-dev.lock --output-file requirements.lock
	for extra in upload slurm mlflow docs browser; do \
		$(LOCK) $(UPGRADE) --extra $$extra --constraint requirements-dev.lock --output-file requirements-$$extra.lock || exit 1; \
	done

# Removes what the pipeline has made; logs in flights/, the environment and the history of the decisions stay.
clean:
	rm -rf .snakemake .cache demo-loop build dist
	@[ ! -d results ] || find results -mindepth 1 -maxdepth 1 ! -name history -exec rm -rf {} +
