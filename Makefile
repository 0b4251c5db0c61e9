# Needs only Python >= 3.10 and make. Start with `make map`.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
DEV    := $(VENV)/.ready-dev
SAMPLE := sample_logs/slam-sd.mcap
OUT    ?= out/sample
FUZZ_SECONDS ?= 60
BASELINE ?= out/same-results.json

.PHONY: help map test kernels lint same-results docs bench papers fuzz newcomer samples clean
.DEFAULT_GOAL := help

help:
	@echo "make map      set up, then map the sample log: the picture is $(OUT)/map.png"
	@echo "make test     lint, then all tests"
	@echo "make kernels  compile all kernels, once per installation"
	@echo "make lint     ruff, mypy, import-linter"
	@echo "make same-results  compare the results of all methods with those recorded in $(BASELINE)"
	@echo "make docs     build the pages and the API as a site: out/site/index.html"
	@echo "make bench    measure speed, memory and accuracy, and check them against their bounds"
	@echo "make papers   repeat the papers' experiments and write docs/papers.md"
	@echo "make fuzz     feed every reader damaged input for FUZZ_SECONDS each"
	@echo "make newcomer time the path from git clone to the first map, with nothing cached"
	@echo "make samples  regenerate the sample logs"
	@echo "make clean    remove everything that make has built"
	@echo "PYTHON=python3.12 chooses the interpreter of $(VENV)"

map: $(READY)
	$(BIN)/gridslam map $(SAMPLE) -c slam-sd -o $(OUT) --force
	$(BIN)/gridslam evaluate $(OUT) --truth $(SAMPLE:.mcap=.truth) --sync interpolate
	@echo
	@echo "The map is $(OUT)/map.png; $(OUT)/report.html has the details."

# Kernels are compiled while the tools are installed and lint runs.
test: $(READY)
	$(MAKE) --jobs=2 kernels lint
	$(BIN)/python -m pytest -n 2 --dist worksteal

kernels: $(READY)
	$(BIN)/gridslam warmup

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

same-results: $(DEV)
	$(BIN)/python -m tests.same_results compare $(BASELINE)

docs: $(DEV)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet
	@echo "The site is out/site/index.html."

bench: $(DEV)
	$(BIN)/python -m tests.benchmarks.harness

papers: $(DEV)
	$(BIN)/python -m tests.papers.make

fuzz: $(DEV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fuzz]'
	$(BIN)/python -m tests.fuzz.run $(FUZZ_SECONDS)

newcomer:
	sh tests/end_to_end/newcomer.sh

samples: $(DEV)
	$(BIN)/python -m gridslam.simulation.samples sample_logs

clean:
	rm -rf $(VENV) out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks tests/failures
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamp file is written last, so an interrupted set-up is repeated; changed dependencies are installed into the existing
# environment.
$(READY): pyproject.toml setup.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
		{ echo "gridslam needs Python 3.10 or newer; choose one with: make PYTHON=/path/to/python3" >&2; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "$(PYTHON) lacks venv; on Debian or Ubuntu: apt install python3-venv" >&2; exit 2; }
	@echo "setting up $(VENV) (once; a few minutes)"
	@test -e $@ || $(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@$(BIN)/python -m compileall -q gridslam cli  # for where Python may not keep bytecode, as in many containers
	@touch $@

$(DEV): $(READY)
	@echo "installing what tests, lint and the simulator need (once)"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[sim,test,lint,docs]'
	@touch $@
