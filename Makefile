# make demo, make test: both work from a bare clone with nothing but python3 and make.
.PHONY: demo test test-slow test-vm fuzz bench bench-grid bench-render bench-stops lint types layers format wheel-check clean

BOOTSTRAP := .bootstrap
UV := $(BOOTSTRAP)/bin/uv
PYTHON_VERSION ?= 3.11
PYTHON := .venv/bin/python
# Files of tests side by side; each file's in their order.
TEST_WORKERS ?= 2

demo: .venv/ready
	$(PYTHON) -m experiments corridor

test: .venv/ready
	$(PYTHON) -m pytest -n $(TEST_WORKERS) --dist loadfile

# What `make test` leaves out.
test-slow: .venv/ready
	$(PYTHON) -m pytest -m slow

# Real V4L2 devices, in a virtual machine; says which Debian packages it needs.
test-vm: .venv/ready
	$(PYTHON) tests/vm

# Ten minutes of CPU for each reader of foreign bytes.
fuzz: .venv/ready
	$(PYTHON) tests/fuzz --minutes 10

# Minutes on 2 cores; needs STEREOGRID_DATA, the folder of the real data.
bench: bench-grid
	$(PYTHON) -m experiments energy --pairs $(STEREOGRID_DATA)/stereo
	$(PYTHON) -m experiments matchers

# The grid's speed and memory beside OctoMap's; needs no data.
bench-grid: .venv/ready
	mkdir -p runs
	$(PYTHON) -m pytest tests/bench/test_grid.py tests/bench/test_pipeline.py --benchmark-json=runs/bench.json --benchmark-columns=min,median,max,rounds -q
	$(PYTHON) -m experiments grid-bench runs/bench.json

# How long it takes until the robot stands, whatever stops it; a minute and a half.
bench-stops: .venv/ready
	$(PYTHON) tests/bench/stops.py

# CPU time of the simulator's pictures and of a recorded drive; needs no data.
bench-render: .venv/ready
	$(PYTHON) -m pytest tests/bench/test_render.py --benchmark-columns=min,median,mean,max,rounds -q

lint: .venv/ready
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .

types: .venv/ready
	.venv/bin/mypy

layers: .venv/ready
	.venv/bin/lint-imports

format: .venv/ready
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

# The wheel alone, in a clean environment, in another folder.
wheel-check: .venv/ready
	$(PYTHON) tests/wheel_check.py $(UV)

# uv lives in a small environment of its own and finds (or fetches) a Python that has every wheel.
$(UV):
	@python3 -m venv $(BOOTSTRAP) 2>/dev/null \
		|| { rm -rf $(BOOTSTRAP); echo "python3 has no venv module (on Debian: apt install python3-venv)" >&2; exit 1; }
	$(BOOTSTRAP)/bin/python -m pip install --quiet --disable-pip-version-check uv

.venv/ready: $(UV) pyproject.toml
	$(UV) venv --quiet --clear --python $(PYTHON_VERSION) .venv
	$(UV) pip install --quiet --python $(PYTHON) --editable ".[sim,hardware,view,score,sweep,test,oracle,bench,dev]"
	touch $@

clean:
	rm -rf .venv $(BOOTSTRAP) .vm dist build
