# One entry for everything; `make demo` and `make test` set up what they need.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
# The versions that CI tests with, by `make lock`; other Pythons take the newest that pyproject.toml allows.
LOCK   := requirements.lock
C_SOURCES := $(wildcard firmware/core/*.[ch] firmware/generated/*.[ch] firmware/boards/native/*.[ch] hil_sim/plant/*.[ch] hil_sim/board/elf/*.[ch])

.PHONY: help setup lock demo docs test lint firmware test-python test-firmware coverage validate bench clean

help: ## print this list
	@grep -E '^[a-z-]+:.*## ' $(firstword $(MAKEFILE_LIST)) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 24

# cffi compiles against Python's own header, which some systems package apart.
$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "impid needs Python 3.11 or newer; none was found" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "impid needs Python 3.11 or newer; $(PYTHON) is older: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import pathlib, sysconfig, sys; sys.exit(not (pathlib.Path(sysconfig.get_path("include")) / "Python.h").exists())' || { echo "Python's C header is missing; on Debian: sudo apt-get install python3-dev" >&2; exit 1; }
	@command -v cc >/dev/null || { echo "impid needs a C compiler; on Debian: sudo apt-get install gcc libc6-dev" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(STAMP): pyproject.toml setup.py $(LOCK) $(C_SOURCES) | $(VENV)/bin/python
	IMPID_SIM=1 $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]' \
	  $$($(BIN)/python -c 'import sys; sys.version_info[:2] == (3, 11) and print("--constraint $(LOCK)")')
	@touch $@

setup: $(STAMP) ## make the virtual environment with everything in it

lock: $(STAMP) ## take the newest versions of everything, and write them down for CI
	IMPID_SIM=1 $(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade \
	  --upgrade-strategy eager --editable '.[dev]'
	$(BIN)/python scripts/lock.py

demo: $(STAMP) ## record, sync, fit and plot on the simulator
	@PATH="$(CURDIR)/$(BIN):$$PATH" scripts/demo.sh

docs: $(STAMP) ## build the documentation site into build/site
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet
	@echo "open build/site/index.html"

test: lint test-firmware test-python ## everything that must pass

lint: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python scripts/generate_protocol.py --check
	scripts/system_packages.sh
	scripts/check_firmware.sh
	scripts/firmware_check.sh

firmware: $(STAMP) ## build all boards and print sizes and stack against their budgets
	scripts/system_packages.sh
	scripts/firmware_build.sh

test-firmware: firmware
	scripts/pio.sh test -e native
	scripts/firmware_coverage.sh
	scripts/firmware_fuzz.sh
	scripts/pio.sh test -e qemu_cortex_m4

test-python: $(STAMP)
	scripts/system_packages.sh
	$(BIN)/pytest -n 2 --dist loadfile -q

coverage: $(STAMP) ## lines of the host that no test runs; fails below 90 %
	$(BIN)/pytest -n 2 --dist loadfile -q tests/host tests/docs tests/protocol tests/bench --cov --cov-report=term-missing:skip-covered

validate: $(STAMP) ## the long forms, with their figures written to docs/validation (several hours)
	@PATH="$(CURDIR)/$(BIN):$$PATH" scripts/validate_recording.sh
	$(BIN)/pytest -m slow -q
	scripts/firmware_fuzz.sh -max_total_time=60
	$(BIN)/python bench/firmware_mutants.py run --jobs 2 --lists board --kept build/mutants.jsonl --markdown docs/validation/mutants.md
	$(BIN)/python bench/firmware_mutants.py run --jobs 2 --lists life --kept build/mutants.jsonl --markdown docs/validation/mutants_life.md
	$(BIN)/python scripts/validate/first_paper.py
	$(BIN)/python scripts/validate/tables_residual.py
	$(BIN)/python bench/cutoff.py 30 --markdown docs/validation/cutoff.md
	$(BIN)/python bench/accelerometer_pays.py 5 --markdown docs/validation/accelerometer_pays.md
	$(BIN)/python bench/coverage.py 1000 --markdown docs/validation/coverage.md
	$(BIN)/python scripts/validate/second_paper.py
	$(BIN)/python scripts/validate/measured_impedance.py
	$(BIN)/python scripts/validate/measured_diagnosis.py
	$(BIN)/python scripts/validate/planted.py
	@mkdir -p build
	$(BIN)/python bench/diagnosis_validation.py run build/diagnosis.jsonl --first-seed 1800000 --jobs 2
	$(BIN)/python bench/diagnosis_validation.py table build/diagnosis.jsonl \
	  --command 'bench/diagnosis_validation.py run build/diagnosis.jsonl --first-seed 1800000 --jobs 2' \
	  --markdown docs/validation/diagnosis.md --json docs/validation/diagnosis.json \
	  --diagram docs/validation/diagnosis_reliability.png

bench: $(STAMP) ## speed and memory of everything that somebody waits for, beside peers (ten minutes)
	$(BIN)/python -m bench.speed --out docs/validation/bench.md

clean: ## remove what was built, but nothing that was recorded
	rm -rf $(VENV) build .pio .pio-core *.egg-info hil_sim/_native*.so hil_sim/_native.c
