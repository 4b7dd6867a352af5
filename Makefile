# `make help` lists the commands. environment.md says what is installed, and why.

help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1	/p' Makefile | expand -t 21

lab: set_up ## open JupyterLab on the first notebook; PORT=8890, BROWSER=no, LAB_ARGS=... change how
	@$(call open_lab,false,/lab/tree/notebooks/00_start_here.ipynb)

present: set_up ## show a copy of a lesson as slides whose cells run: LESSON=02; NEW=yes makes it anew, TABLET=yes shows your notes in the network
	@deck=$$($(PYTHON) -m tools.lessons.present "$(LESSON)" --root "$(ROOT)" $(if $(filter yes,$(NEW)),--new) \
		$(if $(filter no,$(FRESH)),--saved-outputs)) && \
	rm -f "$(JUPYTER_CONFIG_DIR)"/lab/workspaces/present-* \
		$(if $(filter yes,$(NEW)),"$(JUPYTER_CONFIG_DIR)"/lab/workspaces/deck-*) && \
	$(call open_lab,true,/lab/workspaces/present/tree/$$deck)

class: set_up ## see the guesses of a class as they come: LAN=yes lets students join over the network; PORT=8765, BROWSER=no
	@exec $(PYTHON) -m tools.class_server --root "$(ROOT)" $(if $(filter yes,$(LAN)),--lan) $(if $(PORT),--port "$(PORT)") \
		$(if $(filter no,$(BROWSER)),--no-browser) $(CLASS_ARGS)

test: set_up lint ## lint, tests of the helpers, every notebook compared with its saved outputs
	@$(PYTHON) -m pytest -n $(WORKERS) --dist loadscope --max-worker-restart 0 $(PYTEST_ARGS)

test-tools: set_up ## the tools: an installation from nothing, the soak, two machines, the licences, the benchmarks
	@$(PYTHON) -m pytest -n 2 --dist worksteal --max-worker-restart 0 -o faulthandler_timeout=600 tests/tools $(PYTEST_ARGS)

test-browser: ## the real JupyterLab in Chromium, as students and instructors use it; it takes minutes
	@[ -n "$(CHROMIUM)" ] || { echo '$(no_chromium)' >&2; exit 1; }
	@tools/set_up.sh browser && tools/set_up.sh site && $(PYTHON) -m tools.site
	@CHROMIUM="$(CHROMIUM)" $(PYTHON) -m pytest -n 2 --dist worksteal --max-worker-restart 0 -o faulthandler_timeout=600 tests/browser $(PYTEST_ARGS)

image: ## a container image of the lessons, with podman or docker: BASE=, CONTAINER=, IMAGE_ARGS=... change how
	@tools/container/run.sh image

lab-container: ## the lessons in a container of that image, your notebooks in my_lessons/: PORT=8890, LESSONS=FOLDER
	@tools/container/run.sh lab

hub: ## a JupyterHub for a class on this machine; CONTAINERS=yes, HUB_ARGS=... change how. See teaching.md
	@tools/hub/set_up.sh
	@$(if $(filter yes,$(CONTAINERS)),DOCKER_HOST=$$(.venv/bin/python tools/hub/service.py "$$(tools/container/run.sh label)") && export DOCKER_HOST &&) exec .venv/bin/jupyterhub --config tools/hub/jupyterhub_config.py $(HUB_ARGS)

test-hub: ## a class of 12 on a JupyterHub, who run lessons 02 and 03 at the same time; it takes minutes
	@tools/hub/set_up.sh
	@$(PYTHON) -m pytest -n 0 -rA -o faulthandler_timeout=1200 tests/hub $(PYTEST_ARGS)

test-container: set_up ## the container and a class in it, on a Debian from debootstrap, as root; it takes minutes
	@tools/hub/set_up.sh || echo 'LEFT OUT: a class in containers.'
	@$(PYTHON) -m pytest -n 0 -rsP -o faulthandler_timeout=1200 tests/container $(PYTEST_ARGS)

handout: set_up ## a student's edition as one archive: SOLUTIONS=no leaves the solutions out, OFFLINE=yes (PYTHONS="3.11 3.12") adds the packages
	@$(PYTHON) -m tools.lessons.handout $(if $(filter no,$(SOLUTIONS)),--no-solutions) \
		$(if $(filter yes,$(OFFLINE)),--wheels $(or $(PYTHONS),$(this_python)))

update: set_up ## get newer lessons, keep what you have written; FROM=ros2_notebooks.tar.gz names a newer archive
	@$(PYTHON) -m tools.lessons.update $(if $(FROM),"$(FROM)")

notebooks: set_up ## run all notebooks, save their outputs, and write what follows from them; LESSON=02 for one
	@$(PYTHON) -m tools.lessons.run $(LESSON)

lesson: set_up ## begin a lesson: NAME=count_the_losses, AFTER=04 puts it there; REMOVE=yes takes it out
	@$(PYTHON) -m tools.lessons.new "$(NAME)" $(if $(AFTER),--after "$(AFTER)") $(if $(filter yes,$(REMOVE)),--remove)

slides: set_up ## write the lessons as HTML slides into slides/, which need no network; LESSON=02 for one
	@$(PYTHON) -m tools.lessons.export $(LESSON)

site: set_up ## write the lessons and documents as a web site into site/, which needs no network
	@tools/set_up.sh site
	@$(PYTHON) -m tools.site

book: set_up ## write the lessons as a book on paper into book.pdf; it takes minutes
	@tools/set_up.sh site
	@$(PYTHON) -m tools.site book

sources: set_up ## print all external links of the lessons, each with the words that it backs
	@$(PYTHON) -m tools.lessons.sources

soak: set_up ## run the notebooks in hard conditions, as root: N=10 times, CONDITIONS=idle,busy LESSON=02
	@$(PYTHON) -m tools.soak $(if $(N),--rounds "$(N)") $(if $(CONDITIONS),--conditions "$(CONDITIONS)") \
		$(if $(LESSON),--lesson "$(LESSON)")

bench: set_up ## measure what things cost, on an idle machine, against what they could; ONLY="latency model" for some
	@PYTHONPATH=tests $(PYTHON) -m benchmarks $(ONLY)

lint: set_up ## ruff: style and format of modules and notebooks
	@.venv/bin/ruff check && .venv/bin/ruff format --check

lock: set_up ## write requirements.lock from pyproject.toml; UPGRADE=yes takes newer versions
	@tools/lock.sh .venv/bin/uv $(if $(filter yes,$(UPGRADE)),--upgrade)

licences: ## write licences.md from the lock files and what the packages say
	@for group in browser site hub; do tools/set_up.sh $$group || exit; done
	@$(PYTHON) -m tools.licences

clean: ## remove the environment, JupyterLab's state, caches and what lessons built; students' files stay
	if [ -d .jupyter ]; then find .jupyter -mindepth 1 -maxdepth 1 ! -name hub -exec rm -rf {} +; fi
	rm -rf .venv .soak scratch slides handout site .site book.pdf .hypothesis .pytest_cache .ruff_cache
	find . \( -name .git -o -path ./my_lessons -o -path ./presentation -o -path ./.jupyter/hub \) -prune -o \
		\( -name __pycache__ -o -name .ipynb_checkpoints \) -prune -exec rm -rf {} +

set_up:
	@mkdir -p .jupyter && tools/set_up.sh

.PHONY: help lab present class test test-tools test-browser image lab-container hub test-hub test-container handout update notebooks \
	lesson slides site book sources soak bench lint lock licences clean set_up

PYTHON := .venv/bin/python

# Notebooks mostly wait, so more of them than cores run at once. A notebook stays in one worker. None
# is replaced: where one has crashed, pytest-xdist may wait for its successor for ever.
WORKERS := 4

CHROMIUM ?= $(shell command -v chromium || command -v chromium-browser || command -v google-chrome)
no_chromium = There is no Chromium: install it, on Debian with `sudo apt install chromium`, or name yours with CHROMIUM=...

ROOT := .

this_python = $(shell $(PYTHON) -I -S -c 'import sys; print("%d.%d" % sys.version_info[:2])')

# The first argument says whether JupyterLab shows the notebook as slides, the second is its address.
# A port that you name is the one you get, or an error. Without a name, the first free one from 8888.
# A window of `make lab` and one of `make present` may be open side by side: each has its settings.
open_lab = settings="$(JUPYTER_CONFIG_DIR)/lab/$(if $(filter true,$(1)),presenter,user)-settings" && \
	slides="$$settings/jupyterlab-slideshow" && \
	mkdir -p "$(JUPYTER_CONFIG_DIR)/custom" "$$slides" && \
	cp tools/deck.css "$(JUPYTER_CONFIG_DIR)/custom/custom.css" && \
	echo '{"active": $(1)}' > "$$slides/plugin.jupyterlab-settings" && \
	JUPYTERLAB_SETTINGS_DIR="$$settings" TABLET="$(TABLET)" exec $(PYTHON) -m jupyterlab --ServerApp.root_dir="$(ROOT)" --LabApp.custom_css=True \
	--LabApp.default_url="$(2)" $(if $(filter true,$(1)),--LabApp.extra_labextensions_path="$(CURDIR)/tools/labextensions" \
	--ServerApp.jpserver_extensions=tools.notes_window=True) \
	$(if $(PORT),--port="$(PORT)" --ServerApp.port_retries=0) \
	$(if $(filter no,$(BROWSER)),--no-browser) \
	$(if $(filter 0,$(shell id -u)),--allow-root) $(LAB_ARGS)

# What you have set for other work stays out: another ROS 2 that is sourced, Python's and Jupyter's
# variables, the settings in your home folder. What must not reach a build stands in
# helpers/build_tools.py. JupyterLab's state of this course is in .jupyter.
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
