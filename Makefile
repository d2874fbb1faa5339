# Entry points of the suite; `make help` lists them. Nothing has to be sourced beforehand.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
# The build belongs to this checkout alone, whatever workspace or Python the calling shell uses.
unexport CMAKE_PREFIX_PATH ROS_PACKAGE_PATH PYTHONPATH PYTHONHOME VIRTUAL_ENV PYENV_VERSION
# Programs start again and again: without compiled modules each start compiles them anew.
unexport PYTHONDONTWRITEBYTECODE
# Messages are made for C++ and Python; `make deb` makes them for all languages, as others expect.
export ROS_LANG_DISABLE := geneus:genlisp:gennodejs

# What was compiled before, in whatever clone, comes out of ccache: paths count from the clone's root.
export CCACHE_BASEDIR := $(CURDIR)
export CCACHE_NOHASHDIR := 1
# Likewise what mypy found out; it holds hashes of all files against what it is given.
export MYPY_CACHE_DIR := $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/atom/mypy
CCACHE = $(if $(shell command -v ccache),-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)

JOBS := $(shell nproc)
REPEAT := 1
BUILD_TYPE := Release
# A module of tests stays in one process, since its tests share what it made. One thread of linear
# algebra in each process: more of them would only take the processors from one another.
PYTEST = env OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python3 -m pytest -n $(JOBS) --dist loadfile \
	--no-loadscope-reorder --durations 20
# Every recipe that runs Python, ROS or a tool of the virtual environment starts with this.
ENV := source ./env.bash;
PYTHON_FILES = $$(git ls-files --cached --others --exclude-standard --deduplicate \
	-- '*.py' ':(glob)**/scripts/*' | xargs -r ls -d 2>/dev/null)
CPP_FILES = $$(git ls-files --cached --others --exclude-standard --deduplicate \
	-- '*.h' '*.cpp' | xargs -r ls -d 2>/dev/null)

.PHONY: help setup build demo test test-noetic-versions test-opencv-versions test-debian11 test-regression test-rviz test-quick test-long test-sanitizers coverage mutants lint format bench bench-labels bench-hand-eye results deb clean pictures pictures-cell

help: ## this list
	@sed -n 's/^\([a-z0-9-]*\):.*## \(.*\)/\1	\2/p' Makefile | expand -t 14

setup: ## system packages (apt, root or sudo) and the virtual environment .venv; only what is missing
	@flock requirements bash requirements/setup.bash

# The root is a catkin package that brings in the others, so one plain cmake build does it.
# The interpreter is the virtual environment's, which sees Debian's ROS modules.
# C++ tests run under the address and undefined sanitizers. PCL's libraries take Eigen's arrays for
# what malloc gave, as it is without sanitizers.
SANITIZED = -fsanitize=address,undefined;-fno-sanitize-recover=undefined;-O0;-g1;-DEIGEN_MALLOC_ALREADY_ALIGNED=1
CONFIGURE = cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=$(BUILD_TYPE) -DCMAKE_PREFIX_PATH= \
	-DPYTHON_EXECUTABLE="$$PWD/.venv/bin/python3" -DCATKIN_ENABLE_TESTING=ON \
	-DCATKIN_DEVEL_PREFIX="$$PWD/devel" -DCMAKE_INSTALL_PREFIX="$$PWD/install" \
	-DATOM_TEST_FLAGS="$(SANITIZED)" $(CCACHE)
COMPILE = flock CMakeLists.txt cmake --build build -j $(JOBS)

.PHONY: configure
configure: setup
	@[ build/build.ninja -nt Makefile ] || flock CMakeLists.txt $(CONFIGURE)

build: configure ## compile into build/ and devel/
	@$(COMPILE)

# In a build space of its own: the programs run Debian's Python and stand below /opt/atom.
deb: setup ## a Debian package of the install space, below /opt/atom, in build_deb/
	@env -u ROS_LANG_DISABLE cmake -S . -B build_deb -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH= \
		-DPYTHON_EXECUTABLE=/usr/bin/python3 -DCATKIN_ENABLE_TESTING=OFF \
		-DCATKIN_DEVEL_PREFIX="$$PWD/build_deb/devel" -DCMAKE_INSTALL_PREFIX=/opt/atom $(CCACHE)
	@env -u ROS_LANG_DISABLE cmake --build build_deb -j $(JOBS)
	@cd build_deb && rm -f *.deb && PYTHONDONTWRITEBYTECODE=1 ATOM_WITHOUT_COMPILED_PYTHON=1 cpack --config CPackConfig.cmake && ls -l *.deb

demo: build ## the main job on the simulated cell, from bags to evaluation, in demo_output/; EXAMPLE=rihbot: on that robot
	@$(ENV) rosrun atom_examples demo --overwrite $(if $(EXAMPLE),--example $(EXAMPLE) --output demo_output/$(EXAMPLE),--output demo_output)

test: setup ## lint, the build, and every test: pytest, gtest, rostest
	@bash tests/noetic_versions.bash --prepare
	@bash tests/all.bash $(JOBS) $(PYTEST)

test-regression: build ## does calibration still work? rostests on recordings of the simulated cell
	@$(ENV) cd build && ROS_HOME="$$PWD/ros_home" ctest -j $(JOBS) --output-on-failure -R regression

test-noetic-versions: ## the core with Noetic's Python 3.8, numpy, scipy, OpenCV; skipped without Python 3.8
	@bash tests/noetic_versions.bash $(ARGS)

test-opencv-versions: build ## the labelers with OpenCV from 4.2 to 5, in a table (requirements/opencv.txt)
	@$(ENV) bash tests/opencv_versions.bash $(ARGS)

test-debian11: ## build and tests in a root of Debian 11 (root; 7 GB in .debian11 or $ATOM_DEBIAN11_ROOT)
	@bash tests/debian11.bash

test-rviz: build ## RViz by mouse and keys on a screen of its own (Xvfb); REPEAT=10 runs it ten times
	@$(ENV) $(COMPILE) --target tests; cd build && ROS_HOME="$$PWD/ros_home" \
	ctest --output-on-failure -R atom_rviz_plugins_rostest --repeat until-fail:$(REPEAT)

test-quick: build ## the tests that are not marked slow
	@$(ENV) $(PYTEST) -m "not slow and not long"

test-sanitizers: setup ## C++ with the address, undefined and thread sanitizers, in sanitizer_output/; half an hour
	@$(ENV) bash tests/sanitizers.bash $(JOBS)

coverage: build ## statements that the tests execute, Python and C++, in coverage_output/; three quarters of an hour
	@$(ENV) bash tests/coverage.bash $(JOBS) $(PYTEST)

mutants: build ## small faults in the core, drawn by chance: do the tests notice? in mutants_output/; an hour and a half
	@$(ENV) [ -d .mutation ] || python3 -m pip install --quiet --disable-pip-version-check --target .mutation \
		-r requirements/mutants.txt
	@$(ENV) python3 tests/mutants.py $(ARGS)

test-long: build ## statistics over many simulated rigs, fuzzing, kills, all variants: what `make test` does small
	@$(ENV) $(PYTEST) -m long

lint: setup lint-only ## ruff, mypy, import-linter, clang-format, catkin_lint

.PHONY: lint-only
lint-only:
	@$(ENV) failed=(); \
	run() { echo "lint: $$1 $${2:-}"; "$$@" || failed+=("$$1 $${2:-}"); }; \
	run ruff check $(PYTHON_FILES); \
	run ruff format --check $(PYTHON_FILES); \
	run mypy atom_core/src atom_calibration/src atom_examples/src; \
	PYTHONPATH=atom_core/src:atom_calibration/src run lint-imports --no-logo; \
	run clang-format --dry-run -Werror $(CPP_FILES); \
	run catkin_lint --offline --quiet --strict --severity-level 1 $$(dirname */package.xml); \
	if [ "$${#failed[@]}" -gt 0 ]; then echo "lint: failed: $${failed[*]}" >&2; exit 1; fi

format: setup ## apply ruff and clang-format
	@$(ENV) ruff check --fix --quiet $(PYTHON_FILES) || true
	@$(ENV) ruff format $(PYTHON_FILES)
	@$(ENV) clang-format -i $(CPP_FILES)

bench: build ## measure speed and accuracy; results in bench_output/
	@$(ENV) python3 tests/benchmarks/bench.py $(ARGS)

bench-labels: build ## speed and accuracy of the labelers, on synthetic and on real data
	@$(ENV) python3 tests/benchmarks/bench_labeling.py; \
	python3 tests/benchmarks/bench_lidar_labeling.py; python3 tests/benchmarks/bench_real_data.py; \
	python3 tests/benchmarks/bench_exposures.py; \
	python3 tests/benchmarks/bench_lidar_models.py; python3 tests/benchmarks/bench_hard_labels.py

bench-hand-eye: build ## ours against OpenCV's hand-eye methods on the same labels, a minute; page in docs/results
	@$(ENV) python3 tests/benchmarks/bench_hand_eye.py --keep docs/results

results: build ## the paper's tables and the labels against their truth, docs/results; an hour and a quarter, 22 GB
	@$(ENV) python3 tests/benchmarks/results.py

clean: ## remove build products and tool caches (keeps the virtual environments and results)
	rm -rf build build_deb devel install .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -not -path './.venv/*' -prune -exec rm -rf {} +

pictures: build ## the pictures of the documents, docs/pictures, from the simulated cell
	@$(ENV) python3 docs/make_pictures.py; python3 docs/make_hard_scenes.py

pictures-cell: build ## what the simulated cell's sensors see, docs/pictures/cell_*.jpg
	@$(ENV) python3 docs/make_cell_pictures.py
