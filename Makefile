# Two jobs for a newcomer: `make reproduce` and `make test`. Both build .venv first if it is not there; `make help` says the rest.
PYTHON ?= python3
VENV := .venv
LOWEST := .venv-lowest
PEERS := .venv-peers
RAY := .venv-ray
WARP := .venv-warp
BIN := $(VENV)/bin
PIP := -m pip install --quiet --disable-pip-version-check
OUT ?= out/paper
BENCH ?= out/bench.json
WORKERS ?= 2
TESTS ?=
NUMBERS ?=
GATES := types test docs fresh thorough attack digests browser peers ray warp

.PHONY: all reproduce test types pytest test-lowest docs films envelope numbers fresh browser thorough attack digests mutants bench peers ray warp real lint hooks clean help

help:
	@echo "make reproduce    fly the paper's five experiments on both plants; OUT=$(OUT) is the folder of the results"
	@echo "make test         lint, and most tests (thorough, attack, digests: the rest); TESTS='tests/plant -k wind' runs these only"
	@echo "make all          types, test, docs, fresh, thorough, attack, digests, browser, peers, ray, warp, one after the other: an hour or two"
	@echo "make pytest       these tests without lint; TESTS as above"
	@echo "make test-lowest  every test on the lowest versions of pyproject.toml, in $(LOWEST); PYTHON must be 3.11"
	@echo "make docs         fill the generated tables of the pages, build the site, out/docs/site/index.html; run all that README, docs and examples show"
	@echo "make films        the moving pictures of README and docs, drawn anew into docs/images: some minutes"
	@echo "make envelope     fly the envelope of the laws anew into out/envelope; writes docs' tables and figure of it"
	@echo "make numbers      run the commands behind the measured tables of docs that were not run for this tree, write the tables; NUMBERS='--list' names them; hours"
	@echo "make fresh        build source and wheel into dist, install the wheel alone, weigh it, run the commands shown"
	@echo "make browser      the studio's page in Chromium, drawn in software; needs node, npm and Chromium"
	@echo "make thorough     more cases of what 'make test' samples: laws, vehicles, files, junk: some minutes"
	@echo "make attack       kills at random times, signal races, full disks, forged folders, fuzzed files: some minutes"
	@echo "make digests      every flight of the paper's cases against the digest it had: some twenty minutes"
	@echo "make mutants      change 300 drawn lines, one at a time, and name those no test sees: hours; WORKERS=$(WORKERS) processes"
	@echo "make bench        measure every engine, many flights, first and repeated ones, here; BENCH=$(BENCH) is the file of the numbers"
	@echo "make peers        fly the other libraries of the bench once, in $(PEERS): two minutes; docs/performance.md has the long form"
	@echo "make ray          sweeps on a Ray cluster of two nodes on this machine, one of them killed, in $(RAY): some minutes"
	@echo "make warp         step every exported vehicle in MuJoCo Warp, on the CPU, and Newton beside MuJoCo, in $(WARP): some minutes"
	@echo "make real         identify on half of each public flight, predict the other; fetches 20 MB into out/real once, or REAL_LOGS=FOLDER; a quarter of an hour; no gate of 'make all'"
	@echo "make lint         ruff, import contract"
	@echo "make types        mypy"
	@echo "make hooks        run lint's quick parts before each commit (pre-commit, in $(VENV))"
	@echo "make clean        remove environments, results, builds and caches"
	@echo "PYTHON=$(PYTHON) makes the environments, of the versions in constraints.txt."

$(VENV)/.core: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python $(PIP) -c constraints.txt -e .
	@touch $@

# not after .core: one installation is ten seconds shorter than two; the tests write the byte code of what they import
# (tests/conftest.py), which is a quarter of what pip would compile
$(VENV)/.test: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python $(PIP) --no-compile -c constraints.txt -e ".[test]"
	@touch $(VENV)/.core $@

reproduce: $(VENV)/.core
	$(BIN)/python -m skyarm reproduce --out $(OUT)

lint: $(VENV)/.test
	$(BIN)/ruff check src tests research
	$(BIN)/ruff format --check src tests research
	$(BIN)/lint-imports

# what one gate alone needs is a quarter of what the others do
$(VENV)/.types: EXTRAS := types
$(VENV)/.thorough: EXTRAS := casadi,film
$(VENV)/.types $(VENV)/.thorough: $(VENV)/.test
	$(BIN)/python $(PIP) --no-compile -c constraints.txt -e ".[$(EXTRAS)]"
	@touch $@

types: $(VENV)/.types
	$(BIN)/mypy

# without the types: they take a core for a minute, and are checked before a push and by the workflow
test: lint pytest

# goes on after a red gate; the lines of all come last
all:
	@lines= code=0; for gate in $(GATES); do \
		begin=$$(date +%s); \
		if $(MAKE) --no-print-directory $$gate; then found=green; else found=RED code=1; fi; \
		lines="$$lines$$gate: $$found after $$(( $$(date +%s) - begin )) s\n"; \
	done; printf "$$lines"; exit $$code

pytest: $(VENV)/.test
	$(BIN)/pytest $(TESTS)

$(LOWEST)/.installed: pyproject.toml tests/lowest.py
	rm -rf $(LOWEST)
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python tests/lowest.py pins > $(LOWEST)/pins.txt
	$(LOWEST)/bin/python $(PIP) -r $(LOWEST)/pins.txt
	$(LOWEST)/bin/python $(PIP) --no-deps -e .
	@touch $@

test-lowest: $(LOWEST)/.installed
	$(LOWEST)/bin/python tests/lowest.py run

$(VENV)/.docs: $(VENV)/.test
	$(BIN)/python $(PIP) -c constraints.txt -e ".[docs]"
	@touch $@

docs: $(VENV)/.docs
	$(BIN)/python tests/website/generated_blocks.py --write
	$(BIN)/python tests/website/build_site.py
	$(BIN)/pytest -m "not attack and not digests and not thorough" tests/test_readme.py tests/test_docs*.py tests/website tests/openness

WIND := case3_wind --laws paper_pd,paper_ct,centroidal_tip --label PD --label CT --label "centroidal law"

PRESS := examples/press_and_slide.toml --label "centroidal law with interaction"

SMALL := --size 480x300 --fps 8 --speed 3 --fine --without ghost

films: $(VENV)/.thorough
	$(BIN)/python -m skyarm film $(WIND) docs/images/laws_in_wind.webp --layout over --camera fixed --fine \
		--window 0 15 --speed 1.5 --size 800x450 --fps 15
	$(BIN)/python -m skyarm film $(WIND) docs/images/laws_in_wind.mp4 --size 960x540
	$(BIN)/python -m skyarm film $(PRESS) docs/images/press_and_slide.webp --camera fixed --without ghost --fine \
		--window 0 11 --speed 1.5 --size 720x450 --fps 12
	$(BIN)/python -m skyarm film examples/pick_and_place_box.toml docs/images/pick_and_carry.webp $(SMALL)
	$(BIN)/python -m skyarm film examples/reach_into_box.toml docs/images/reach_into_box.webp $(SMALL)
	$(BIN)/python -m skyarm film examples/pick_with_fingers.toml docs/images/pick_with_fingers.webp $(SMALL)
	$(BIN)/python -m skyarm film examples/see_with_the_wrist.toml docs/images/see_with_the_wrist.webp --inset wrist \
		--size 400x560 --fps 10 --fine --without plot,ghost
	$(BIN)/python -m skyarm film open_door docs/images/open_door.webp $(SMALL)
	$(BIN)/python -m skyarm film two_carry_a_bar docs/images/two_carry_a_bar.webp --size 800x450 --fps 10 --speed 4 \
		--fine --without ghost --camera fixed
	$(BIN)/python -m skyarm film two_hold_a_bar docs/images/two_hold_a_bar.webp $(SMALL) --speed 1.5 --camera fixed
	$(BIN)/python -m skyarm plan catch_a_ball --out out/catch.npz --scenario out/catch.toml
	$(BIN)/python -m skyarm film out/catch.toml docs/images/catch_a_ball.webp --window 1 5 --size 640x360 --fps 12 \
		--fine --without ghost
	$(BIN)/python -m skyarm plan eagle_catch --out out/eagle.npz --scenario out/eagle.toml
	$(BIN)/python -m skyarm film out/eagle.toml docs/images/eagle_catch.webp --window 1.4 3.6 --size 480x300 --fps 10 \
		--speed 0.5 --fine --without ghost

ENVELOPE_LAWS := paper_pd,paper_ct,l1_adaptive,nmpc,centroidal_tip

envelope: $(VENV)/.test
	$(BIN)/python -m skyarm compare envelope-suite --out out/envelope --laws $(ENVELOPE_LAWS)
	$(BIN)/python tests/website/envelope_of_laws.py out/envelope

# NUMBERS='--only delays' measures one table; what ended is kept in out/numbers
numbers: $(VENV)/.thorough
	$(BIN)/python tests/website/measured_numbers.py $(NUMBERS)

fresh:
	$(PYTHON) tests/release.py build
	$(PYTHON) tests/release.py install

browser: $(VENV)/.test
	npm install --silent --no-audit --no-fund --prefix $(VENV)/browser playwright-core
	NODE_PATH=$(CURDIR)/$(VENV)/browser/node_modules STUDIO_BROWSER=1 $(BIN)/pytest -n 0 tests/view/studio/test_browser.py

thorough: $(VENV)/.thorough
	$(BIN)/pytest -m thorough $(TESTS)

attack: $(VENV)/.test
	$(BIN)/pytest -m attack tests/attacks

# nmpc rounds as BLAS and NumPy do, which choose their code by the processor: those that the digests were taken with
digests: $(VENV)/.test
	OPENBLAS_CORETYPE=Haswell NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_ICL AVX512_SPR" $(BIN)/pytest -m digests tests/simulate/test_flight_digests.py

mutants: $(VENV)/.test
	$(BIN)/python tests/mutation/mutants.py reach --workers $(WORKERS)
	$(BIN)/python tests/mutation/mutants.py run --workers $(WORKERS)
	$(BIN)/python tests/mutation/mutants.py score

bench: $(VENV)/.test
	$(BIN)/python tests/studies/bench/measure_engines.py --out $(BENCH)
	$(BIN)/python tests/studies/bench/measure_flights.py
	$(BIN)/python tests/studies/bench/measure_speed.py

# PyFlyt asks for NumPy 1 and flies on 2, which another of them needs
$(PEERS)/.installed: pyproject.toml tests/studies/bench/peers.txt
	rm -rf $(PEERS)
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/python $(PIP) -r tests/studies/bench/peers.txt -e ".[gym]"
	$(PEERS)/bin/python $(PIP) --no-deps PyFlyt==0.29.0
	@touch $@

peers: $(PEERS)/.installed
	$(PEERS)/bin/python tests/studies/bench/measure_peers.py --small

# the other eighteen nodes that are killed: $(RAY)/bin/pytest -n 0 -m thorough tests/studies/flights/test_ray_rows.py
$(RAY)/.installed: pyproject.toml constraints.txt
	rm -rf $(RAY)
	$(PYTHON) -m venv $(RAY)
	$(RAY)/bin/python $(PIP) -c constraints.txt pytest pytest-xdist -e ".[sweep,ray]"
	@touch $@

ray: $(RAY)/.installed
	$(RAY)/bin/pytest -n 0 tests/studies/flights/test_ray_*.py tests/test_docs_clusters.py

# Newton asks for an older MuJoCo, and steps on the newer one with a warning
$(WARP)/.installed: pyproject.toml constraints.txt
	rm -rf $(WARP)
	$(PYTHON) -m venv $(WARP)
	$(WARP)/bin/python $(PIP) -c constraints.txt mujoco-warp==4.0.0 newton==1.8.0 -e .
	@touch $@

warp: $(WARP)/.installed
	$(WARP)/bin/python tests/plant/step_exported.py

# a gate for people: of what strangers' hosts still hold, and of real vehicles that no model explains
real: $(VENV)/.test
	$(BIN)/python tests/identify/measure_real.py

hooks: $(VENV)/.types
	$(BIN)/python $(PIP) -c constraints.txt pre-commit
	$(BIN)/pre-commit install

clean:
	rm -rf $(VENV) $(LOWEST) $(PEERS) $(RAY) $(WARP) out build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
