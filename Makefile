# `make help` lists the commands. environment.md says what is installed, and why.

help: ## show this list
	@sed -n 's/^\([a-z0-9-]*\):.*## /  make \1	/p' Makefile | expand -t 23

lab: set_up ## open JupyterLab on the first notebook; PORT=8890, BROWSER=no, OUTPUTS=yes (those of the repository), LAB_ARGS=... change how
	@exec $(PYTHON) -m tools.lab $(if $(filter yes,$(OUTPUTS)),--outputs) $(server) -- $(LAB_ARGS)

present: set_up ## show a copy of a lesson as slides whose cells run: LESSON=02, or PLAN=90, a timetable; NEW=yes makes it anew; CLASS= names the class of a hub
	@exec $(PYTHON) -m classroom.present --lessons "$(LESSON)" --plan "$(PLAN)" --class "$(CLASS)" $(if $(filter yes,$(NEW)),--new) \
		$(server) -- $(LAB_ARGS)

class: set_up ## see the guesses of a class as they come: LAN=yes lets students join over the network; PORT=8765, BROWSER=no
	@exec $(PYTHON) -m classroom.class_page $(if $(filter yes,$(LAN)),--lan) $(server)

test: set_up ## the course: style, tests of the helpers, every notebook compared with its saved outputs; LESSON=02 for one
	@answers="extend-exclude=[$$($(PYTHON) -m tools.lessons.answers)]" && \
		.venv/bin/ruff check --config "$$answers" && .venv/bin/ruff format --check --config "$$answers"
	@$(PYTHON) -m pytest -n $(WORKERS) --dist loadscope --max-worker-restart 0 $(lesson) $(PYTEST_ARGS)

test-ros2: set_up ## the `ros2` command, a package of its own in ros2/
	@$(PYTHON) -m pytest -n 2 --dist loadscope --max-worker-restart 0 -o faulthandler_timeout=600 ros2 $(PYTEST_ARGS)

test-tools: set_up ## the tools: an installation from nothing, a new lesson, two machines
	@$(PYTHON) -m pytest -n 2 $(slow) tests/tools $(PYTEST_ARGS)

test-packages: set_up ## each package that a learner ends with, where only what it names is installed; LESSON="09 12"
	@$(PYTHON) -m pytest -n 2 $(slow) tests/packages $(lesson) $(PYTEST_ARGS)

test-answers: set_up ## each check of the lessons judges the answers in tests/answers; it takes half an hour; LESSON=02 TASK=3
	@$(PYTHON) -m pytest -n $(WORKERS) $(slow) -o faulthandler_timeout=1800 tests/answers $(lesson) $(if $(TASK),-k "$(shell printf task_%02d $(TASK))") $(PYTEST_ARGS)

test-browser: ## the real JupyterLab and the site in Chromium, as students use them; it takes minutes
	@tools/set_up.sh browser && tools/set_up.sh site && $(PYTHON) -m tools.site
	@$(PYTHON) -m pytest -n 2 $(slow) tests/browser $(PYTEST_ARGS)

test-classroom: ## slides, notes and class page; then a class of 12 on a JupyterHub, and the container; it takes minutes
	@tools/set_up.sh browser && { classroom/hub/set_up.sh || echo 'LEFT OUT: the hub.'; }
	@failed=0; \
	$(PYTHON) -m pytest -n 2 $(slow) --ignore classroom/tests/hub classroom/tests $(PYTEST_ARGS) || failed=$$?; \
	$(PYTHON) -m pytest -n 0 -rsP -o faulthandler_timeout=1200 classroom/tests/hub $(PYTEST_ARGS) || failed=$$?; \
	exit $$failed

image: ## a container image of the lessons, with podman or docker: SOLUTIONS=no, BASE=, CONTAINER=, IMAGE_ARGS=... change how
	@SOLUTIONS=$(SOLUTIONS) classroom/container/run.sh image

lab-container: ## the lessons in a container of that image, your notebooks in my_lessons/: PORT=8890, LESSONS=FOLDER
	@classroom/container/run.sh lab

hub: ## a JupyterHub for a class on this machine; SOLUTIONS=no, CONTAINERS=yes, HUB_ARGS=... change how. See classroom/HOSTING.md
	@classroom/hub/set_up.sh
	@CONTAINERS=$(CONTAINERS) SOLUTIONS=$(SOLUTIONS) exec $(PYTHON) -m jupyterhub --config classroom/hub/jupyterhub_config.py $(HUB_ARGS)

handout: set_up ## a student's edition as one archive: SOLUTIONS=no leaves the solutions out, OFFLINE=yes (PYTHONS="3.11 3.12") adds the packages
	@$(PYTHON) -m classroom.handout $(if $(filter no,$(SOLUTIONS)),--no-solutions) \
		$(if $(filter yes,$(OFFLINE)),--wheels $(or $(PYTHONS),$(this_python)))

grade: set_up ## judge what students hand in, in a container: FOLDER=submissions, as Moodle or Canvas gives it; LESSON=02, JOBS=2. See teaching.md
	@$(PYTHON) -m classroom.grade "$(or $(FOLDER),submissions)" --lesson "$(LESSON)" --seed "$(SEED)" --assignment "$(ASSIGNMENT)" \
		$(if $(JOBS),--jobs "$(JOBS)") $(if $(LIMIT),--limit "$(LIMIT)") $(if $(filter yes,$(TRUST)),--trust)

update: set_up ## get newer lessons, keep what you have written; FROM=ros2_notebooks.tar.gz names a newer archive
	@$(PYTHON) -m classroom.update $(if $(FROM),"$(FROM)")

notebooks: set_up ## run all notebooks, save their outputs, and write what follows from them; LESSON=02 for one
	@$(PYTHON) -m tools.lessons.run $(LESSON)

lesson: set_up ## begin a lesson: NAME=count_the_losses, AFTER=04 puts it behind that one; REMOVE=yes takes it out
	@$(PYTHON) -m tools.lessons.new "$(NAME)" $(if $(AFTER),--after "$(AFTER)") $(if $(filter yes,$(REMOVE)),--remove)

site: set_up ## write the lessons and documents as a web site into site/, which needs no network
	@tools/set_up.sh site
	@$(PYTHON) -m tools.site

soak: set_up ## before a release, as root: run the notebooks in hard conditions; CONDITIONS="idle busy" LESSON=02
	@tests/soak/run.sh "$(CONDITIONS)" "$(LESSON)"

bench: set_up ## measure what things cost, on an idle machine, against what they could; ONLY="20 200" for some rates
	@PYTHONPATH="$(CURDIR)/tests" $(PYTHON) -m benchmarks $(ONLY)
	@PYTHONPATH="$(CURDIR)/tests" $(PYTHON) -m benchmarks.start

release: set_up ## make handout, site and image of a tagged commit, and say what to publish where
	@tools/release.sh

lint: set_up ## ruff: style and format of all modules and notebooks
	@.venv/bin/ruff check && .venv/bin/ruff format --check

lock: ## write tools/locks from pyproject.toml; UPGRADE=yes takes newer versions
	@tools/lock.sh $(if $(filter yes,$(UPGRADE)),--upgrade)

licences: set_up ## the licence that each installed package names
	@.venv/bin/pip-licenses --from=mixed --with-system --order=license
	@echo 'Unknown above, named in package.xml: the packages of ROS 2.'
	@sed -n 's/.*<license[^>]*>\([^<]*\).*/\1/p' .venv/share/*/package.xml | sort | uniq -c

clean: ## remove the environment, JupyterLab's state, caches and what lessons built; students' files stay
	if [ -d .jupyter ]; then find .jupyter -mindepth 1 -maxdepth 1 ! -name hub -exec rm -rf {} +; fi
	rm -rf .venv .uv scratch handout site .site .hypothesis .pytest_cache .ruff_cache
	find . \( -name .git -o -path ./my_lessons -o -path ./presentation -o -path ./.jupyter/hub \) -prune -o \
		\( -name __pycache__ -o -name .ipynb_checkpoints \) -prune -exec rm -rf {} +

set_up:
	@mkdir -p .jupyter && tools/set_up.sh $(groups)

# What these commands need besides what a learner needs: groups of pyproject.toml.
test test-ros2 test-tools test-packages test-answers test-browser test-classroom notebooks lesson soak bench lint: groups := test
test-browser test-classroom: set_up
licences: groups := test browser site hub licences

.PHONY: help lab present class test test-ros2 test-tools test-packages test-answers test-browser test-classroom image lab-container hub handout grade update notebooks \
	lesson site soak bench release lint lock licences clean set_up

PYTHON := .venv/bin/python

# Notebooks mostly wait, so more of them than cores run at once. A notebook stays in one worker. None
# is replaced: where one has crashed, pytest-xdist may wait for its successor for ever.
WORKERS := 4

# A lesson is named by its number or its name, everywhere: LESSON=02, LESSON=lose_messages, LESSON="02 03".
lesson = $(if $(LESSON),--lesson "$(LESSON)")

# Tests that start servers, browsers and compilers.
slow := --dist worksteal --max-worker-restart 0 -o faulthandler_timeout=600

this_python = $(shell $(PYTHON) -I -S -c 'import sys; print("%d.%d" % sys.version_info[:2])')

ROOT := .
# A port that you name is the one you get, or an error.
server = --root "$(ROOT)" $(if $(PORT),--port "$(PORT)") $(if $(filter no,$(BROWSER)),--no-browser)

# What you have set for other work stays out: another ROS 2 that is sourced, Python's and Jupyter's
# variables, the settings in your home folder. What must not reach a build stands in
# helpers/machine/build_tools.py. JupyterLab's state of this course is in .jupyter.
unexport $(filter PYTHON% ROS_% RMW_% RCUTILS_% FASTDDS_% FASTRTPS_% JUPYTER% IPYTHON% \
	_ROS_WHEELS_BOOTSTRAP_COMPLETE AMENT_PREFIX_PATH VIRTUAL_ENV MPLBACKEND,$(.VARIABLES))
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
# The libraries of that other ROS 2. The wheels set their own path.
unexport LD_LIBRARY_PATH
endif
export JUPYTER_CONFIG_DIR := $(CURDIR)/.jupyter
export JUPYTER_DATA_DIR := $(CURDIR)/.jupyter/data
export JUPYTER_RUNTIME_DIR := $(CURDIR)/.jupyter/runtime
export IPYTHONDIR := $(CURDIR)/.jupyter/ipython
export ROS_LOG_DIR := $(CURDIR)/.jupyter/ros_log
# Its list of fonts. In a home that cannot be written each kernel would make it anew, and warn.
export MPLCONFIGDIR := $(CURDIR)/.jupyter/matplotlib
