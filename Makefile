# Thin: each target is a line or two around CMake, pip, ctest and pytest. `make help` lists them.
PYTHON ?= python3
WERROR ?= $(if $(CI),ON,OFF)
BIN := .venv/bin
SOURCES := $(shell find CMakeLists.txt cpp bindings python -type f -not -path '*/__pycache__/*' -not -path 'cpp/examples/*')

# One compiler by one name for CMake and pip: ccache then compiles the core once for both.
export CXX
export SKBUILD_BUILD_DIR := build/python
export SKBUILD_CMAKE_DEFINE := SIGMAIK_WERROR=$(WERROR)

.NOTPARALLEL:
.PHONY: help demo docs lint test test-browser test-ros2 test-clang test-asan test-tsan fuzz stress bench wheel build install \
        stubs stubs-check clean system

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1  /p' Makefile | awk '{printf "  %s %-12s", $$1, $$2; $$1=$$2=""; print}'

demo: .venv/.demo .venv/.package  ## three arms driven to random poses: which servo arrives, as a picture and a table
	$(BIN)/sigmaik arrival --robot ufactory_xarm7,franka_panda,ur10 --targets random --trials 60 --rate 500 \
	  --servo guided,default,dls,pinv --out build/demo

docs: .venv/.docs .venv/.test .venv/.package  ## the documentation site, in build/docs/html (part of `make test`)
	@tools/setup_system.sh $(PYTHON) doxygen
	mkdir -p build/docs
	doxygen docs/Doxyfile
	$(BIN)/python -m sphinx -q -E -W --keep-going -c docs -d build/docs/doctrees . build/docs/html
	$(BIN)/python -m pytest tests/docs

lint: .venv/.test  ## format, style, types, spelling, and what the repository says of itself
	tools/lint.sh

test: | system  ## everything: lint, install, stubs, C++ tests, Python tests, docs
	@tools/together.sh '$(MAKE) build' '$(MAKE) lint'
	@$(MAKE) .venv/.package
	@tools/together.sh 'tools/check_install.sh build/release' '$(MAKE) docs'
	tools/stubs.sh --check
	ctest --test-dir build/release --output-on-failure -j $$(nproc)
	$(BIN)/python -m pytest -n $$(nproc) --dist worksteal
	$(MAKE) test-browser test-ros2

test-browser: .venv/.test .venv/.package  ## the page of `sigmaik teleop` in Chromium, without a screen (part of `make test`)
	@tools/setup_system.sh $(PYTHON) chromium
	$(BIN)/python -m pytest -n $$(nproc) tests/browser

test-ros2: .venv/.test .venv/.package  ## the ROS 2 node, in processes of its own (part of `make test`)
	$(BIN)/python -m pytest tests/ros2

test-clang:  ## everything in C++, and the Python module, compiled by clang; the C++ tests
test-asan:  ## the C++ tests under the address and undefined-behaviour sanitizers
test-tsan:  ## the C++ tests that use threads, under the thread sanitizer
test-clang test-asan test-tsan: test-%: .venv/.build
	@tools/setup_system.sh $(PYTHON) $(filter clang,$*)
	cmake --preset $*
	cmake --build --preset $*
	ctest --preset $*

FUZZ_SECONDS ?= 600
fuzz: .venv/.test .venv/.package  ## fuzzers by clang on the URDF reader, the cycle and the recording reader; FUZZ_SECONDS=600
	@tools/setup_system.sh $(PYTHON) clang
	@tools/setup_system.sh $(PYTHON) libfuzzer
	cmake --preset fuzz
	cmake --build --preset fuzz
	tools/fuzz.sh $(FUZZ_SECONDS)

stress: build/release/build.ninja  ## ten million random cycles into every limit, 1e5 targets to settle at: counts of what failed
	cmake --build build/release --target sigmaik_stress sigmaik_settling
	build/release/sigmaik_stress 1e7 1 2
	build/release/sigmaik_settling 1e5 1 2

bench: .venv/.bench .venv/.package build/release/build.ninja  ## all benchmarks and the peers: one table, build/bench/bench.json
	cmake build/release  # finds the solvers that .venv has
	cmake --build build/release --target benchmarks
	$(BIN)/python bench/report.py

wheel: .venv/.build  ## a wheel that carries its libraries, in dist/, checked in an empty environment
	tools/build_wheel.sh
	tools/check_wheel.sh dist/*.whl

build: build/release/build.ninja  ## C++ library, tests and examples, in build/release
	cmake --build build/release

install: .venv/.package  ## the Python package, in .venv

stubs: .venv/.test .venv/.package  ## write python/sigmaik/_core.pyi from the compiled module
	tools/stubs.sh

stubs-check: .venv/.test .venv/.package  ## compare python/sigmaik/_core.pyi with the compiled module
	tools/stubs.sh --check

clean:  ## remove what was built; .venv stays
	rm -rf build dist .venv/.package

system:
	@tools/setup_system.sh $(PYTHON)

build/release/build.ninja: CMakePresets.json | system
	cmake --preset release -DSIGMAIK_WERROR=$(WERROR)

.venv/pyvenv.cfg: | system
	$(PYTHON) -m venv .venv

# .build, .demo, .docs, .test, .bench: the packages that building, the demo, the site, the tests and the benchmarks need.
.venv/.build .venv/.demo .venv/.docs .venv/.test .venv/.bench: .venv/.%: .venv/pyvenv.cfg pyproject.toml tools/requirements.py
	$(BIN)/python tools/requirements.py $* > .venv/$*.txt
	$(BIN)/python -m pip install -q --no-compile -r .venv/$*.txt
	$(if $(filter test,$*),@tools/install_torch.sh $(BIN)/python)
	@touch $@

.venv/.package: $(SOURCES) pyproject.toml README.md LICENSE .venv/.build | system
	$(BIN)/python -m pip install -q --no-deps --no-build-isolation --force-reinstall .
	@touch $@
