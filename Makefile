# What a person types in a checkout. Needed beforehand: Python >= 3.10 with venv, make, a C++17 compiler.
# Everything else is installed into virtual environments here and nowhere else.

PYTHON ?= python3
PYTEST ?= .venv/bin/python -m pytest
# The tests of a file share fixtures and stay together; the slow files come first, and short ones fill the end.
PARALLEL = --numprocesses logical --dist loadfile --no-loadscope-reorder

.PHONY: help demo test test-all coverage bare quick without-plugins newest-cmake oldest-cmake cross fuzz fuzz-parsers scale soak peers debian-peers lint types bench quick-bench clean

help:
	@echo "make demo    build examples_ws without any ROS and run its programs"
	@echo "make test    run the tests but the slow ones, on all processors: less than ten minutes on two"
	@echo "make test-all  run the slow ones, too"
	@echo "make coverage  run all of them and measure which lines they run"
	@echo "make bare    run both as on a fresh machine with only Python, make and g++"
	@echo "make quick   run the unit tests and those of the plugins in three minutes"
	@echo "make without-plugins  run 'make quick' and a build without all plugins, then without twelve groups of them; ONLY=lsp without that one"
	@echo "make newest-cmake, make oldest-cmake"
	@echo "             run the tests of CMake code with the newest CMake, or with 3.18 by Ninja and by make"
	@echo "make cross   build examples_ws for aarch64 with zig and run it under qemu: some minutes the first time"
	@echo "make fuzz    compare many random messages of Python, C++ and rosbags, read millions of spoilt ones"
	@echo "make fuzz-parsers  feed spoilt bytes to every parser; SECONDS=3600 says how long"
	@echo "make scale   list, order, build 5,000 packages and chains of 3,000, generate 20,000 interfaces: 25 minutes"
	@echo "make soak    build after long random edits, many kills and faults, compare with clean builds"
	@echo "make peers   install zig, and colcon, rosbags, mcap-ros2-support and EmPy, which tests and bench compare forge with"
	@echo "make lint    check style and format"
	@echo "make types   check types"
	@echo "make bench   measure forge beside its peers and write docs/benchmarks.md; ONLY=cold one scenario"
	@echo "make quick-bench  see that every scenario of it runs"
	@echo "make clean   remove what these commands made"

demo: .venv-demo/.ready
	@. .venv-demo/bin/activate && sh examples_ws/demo.sh

test: .venv/.ready
	$(PYTEST) $(PARALLEL) --skip-slow

test-all: .venv/.ready
	$(PYTEST) $(PARALLEL)

# Measuring takes processor time, above all in tests that start no programs, so that .ci/run does without.
coverage: .venv/.ready
	$(PYTEST) $(PARALLEL) --cov --cov-report=term:skip-covered

bare:
	$(PYTHON) -m tests.bare_machine $(MAKE) demo test

quick: .venv/.ready
	$(PYTEST) $(PARALLEL) --hypothesis-profile quick --skip-slow tests/unit tests/plugins

# In copies of the repository, one after the other.
without-plugins: .venv/.ready
	.venv/bin/python -m tests.without_plugins $(ONLY)

# 'make test' takes the CMake that PATH has; these take the wheels'.
newest-cmake: .venv/.ready
	FORGE_TEST_CMAKE=$(CURDIR)/.venv/bin/cmake FORGE_TEST_MESSAGES=8 \
	  $(PYTEST) $(PARALLEL) -m newest_cmake tests/cmake

oldest-cmake: .venv/.ready .venv-cmake/.ready
	FORGE_TEST_CMAKE=$(CURDIR)/.venv-cmake/bin/cmake $(PYTEST) $(PARALLEL) tests/cmake
	FORGE_TEST_CMAKE=$(CURDIR)/.venv-cmake/bin/cmake CMAKE_GENERATOR="Unix Makefiles" $(PYTEST) $(PARALLEL) tests/cmake

cross: .venv/.ready
	.venv/bin/python -m pip install --quiet --editable '.[cross]'
	FORGE_TEST_ZIG=1 $(PYTEST) tests/e2e/test_cross.py

fuzz: .venv/.ready
	FORGE_CDR_EXAMPLES=200 FORGE_CDR_MUTATIONS=1000000 $(PYTEST) $(PARALLEL) \
	  tests/e2e/test_cdr_differential.py tests/e2e/test_cdr_cpp_python.py

# With atheris in .venv (pip install atheris) inputs are sought that reach new code. Then long files of all
# shapes, twice and four times as long.
fuzz-parsers: .venv/.ready
	.venv/bin/python -m tests.fuzz $(or $(SECONDS),600)
	FORGE_FUZZ_EXAMPLES=1000 FORGE_FUZZ_SIZE=200000 $(PYTEST) tests/fuzz tests/unit/test_injection.py tests/integration/test_injection.py tests/plugins/interface_pages/test_injection.py

scale: .venv/.ready
	FORGE_TEST_SCALE=1 $(PYTEST) -s tests/e2e/test_scale.py

# Fifty kills: thirteen in each of the four tests; fifty faults, a gigabyte of output; two thousand sequences of
# edits, or SEQUENCES, in all ways to build. SEED=2 makes other ones.
soak: .venv/.ready
	FORGE_TEST_KILLS=13 FORGE_TEST_FAULTS=50 FORGE_TEST_FLOOD=1024 FORGE_TEST_SEED=$(or $(SEED),1) \
	  FORGE_TEST_EXAMPLES=60 FORGE_TEST_EDITS=100 FORGE_TEST_SEQUENCES=$(or $(SEQUENCES),2000) \
	  FORGE_TEST_INTERFACE_SEQUENCES=100 $(PYTEST) --numprocesses logical --dist worksteal \
	  tests/e2e/test_incremental.py tests/e2e/test_kill.py tests/e2e/test_faults.py tests/e2e/test_cache.py \
	  tests/e2e/test_exact_installs.py tests/e2e/test_staged_installs.py tests/e2e/test_files_of_others.py

peers: .venv-peers/.ready

lint: .venv/.ready
	.venv/bin/python -m ruff check .
	.venv/bin/python -m ruff format --check .

types: .venv/.ready
	.venv/bin/python -m mypy

# All of it takes some forty minutes on two quiet processors, profiles included. ONLY=cold measures one scenario and leaves the others.
bench: .venv/.ready .venv-peers/.ready .debian-peers/.ready
	.venv/bin/python -m tests.bench --output docs/benchmarks.json $(if $(ONLY),--only $(ONLY))
	$(if $(ONLY),,.venv/bin/python -m tests.bench.profiles --output docs/benchmarks.json)
	.venv/bin/python -m tests.bench.page

quick-bench: .venv/.ready .venv-peers/.ready
	FORGE_TEST_BENCH=1 $(PYTEST) tests/integration/bench/test_bench.py

debian-peers: .debian-peers/.ready

clean:
	rm -rf fuzz .debian-peers .venv .venv-cmake .venv-demo .venv-peers examples_ws/build examples_ws/install examples_ws/log
	rm -rf examples_ws/ros2/build examples_ws/ros2/install examples_ws/ros2/log

# The demo installs forge as its users do: a wheel, with the cmake and ninja wheels beside it.
.venv-demo/.ready: pyproject.toml $(shell find forge templates -type f -not -name '*.pyc')
	$(PYTHON) -m venv .venv-demo
	.venv-demo/bin/python -m pip install --quiet --upgrade '.[cmake]'
	@touch $@

# Dependency groups need a pip that is newer than the one many Pythons bring.
.venv/.ready: pyproject.toml
	$(PYTHON) -m venv .venv
	.venv/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	.venv/bin/python -m pip install --quiet --editable '.[cmake]' --group test
	@touch $@

.venv-cmake/.ready:
	$(PYTHON) -m venv .venv-cmake
	.venv-cmake/bin/python -m pip install --quiet 'cmake==3.18.4.post1'
	@touch $@

# colcon pins old tools of Python packaging: it lives apart, and tests find it by tests/conftest.py. EmPy is there
# twice, in the versions that ROS distributions use.
.venv-peers/.ready:
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python -m pip install --quiet colcon-common-extensions rosbags mcap-ros2-support ziglang
	.venv-peers/bin/python -m pip install --quiet --target .venv-peers/empy-3 'empy==3.3.4'
	.venv-peers/bin/python -m pip install --quiet --target .venv-peers/empy-4 'empy==4.2.1'
	@touch $@

# Debian's own ament, rosidl and Fast-CDR, unpacked and not installed; on other systems nothing comes.
.debian-peers/.ready: tests/bench/debian.py
	$(PYTHON) tests/bench/debian.py .debian-peers
	@mkdir -p .debian-peers && touch $@
