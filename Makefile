# `make help` lists the commands. environment.md says what is installed, and why.

## Learn

help: ## show this list. Capitals are options: make lab PORT=8890
	@sed -n 's/^## \(.*\)/\n\1/p; s/^\([a-z0-9-]*\):.*## /  make \1	/p' Makefile | expand -t 23

lab: set_up ## open JupyterLab on the first notebook: PORT=8890, BROWSER=no, OUTPUTS=yes (saved ones)
	@exec $(PYTHON) -m tools.lab $(if $(filter yes,$(OUTPUTS)),--outputs) $(server) -- $(LAB_ARGS)

update: set_up ## bring newer lessons, keep what you have written: FROM=ros2_notebooks.tar.gz
	@$(PYTHON) -m classroom.update $(if $(FROM),"$(FROM)") && tools/set_up.sh

site: set_up ## write the lessons as a web site into site/, to read offline
	@tools/set_up.sh site
	@$(PYTHON) -m tools.site

lab-container: ## open the lessons in a container: PORT=8890, LESSONS=FOLDER for your notebooks
	@classroom/container/run.sh lab

clean: ## remove the environment, caches and builds; files that you wrote and your progress stay
	@tools/clean.sh

## Teach

present: set_up ## show lessons as slides whose cells run: LESSON=02, PLAN=90 (half, full, two, three), NEW=yes, CLASS=, BROWSER=no
	@exec $(PYTHON) -m classroom.present --lessons "$(LESSON)" --plan "$(PLAN)" --class "$(CLASS)" $(if $(filter yes,$(NEW)),--new) \
		$(server) -- $(LAB_ARGS)

slides: set_up ## print the slides of a lesson as PDF, into handout/slides: LESSON=02
	@$(PYTHON) -m classroom.deck.pdf "$(LESSON)"

class: set_up ## see the guesses of a class as they come: LAN=yes lets students join; URL=https://..., PORT=8765, BROWSER=no
	@exec $(PYTHON) -m classroom.class_page $(if $(filter yes,$(LAN)),--lan) $(if $(URL),--url "$(URL)") $(server)

handout: set_up ## write a student's edition: SOLUTIONS=no (or "00 01"), BORROW=no, OFFLINE=yes (with packages, PYTHONS="3.11 3.12")
	@$(PYTHON) -m classroom.handout $(if $(SOLUTIONS),--solutions "$(SOLUTIONS)") $(if $(BORROW),--borrow "$(BORROW)") \
		$(if $(filter yes,$(OFFLINE)),--wheels $(or $(PYTHONS),$(this_python)))

grade: set_up ## judge what students hand in: FOLDER=submissions, LESSON=02, JOBS=2, CPUS=2, STARS=no; see teaching.md
	@$(PYTHON) -m classroom.grade "$(or $(FOLDER),submissions)" --lesson "$(LESSON)" --seed "$(SEED)" --assignment "$(ASSIGNMENT)" \
		$(if $(filter no,$(STARS)),--no-stars) $(if $(TASKS),--tasks "$(TASKS)") $(if $(JOBS),--jobs "$(JOBS)") $(if $(CPUS),--cpus "$(CPUS)") $(if $(LIMIT),--limit "$(LIMIT)") $(if $(filter yes,$(TRUST)),--trust) \
		$(if $(filter yes,$(PARTIAL)),--partial) $(if $(WEIGHTS),--weights "$(WEIGHTS)") $(if $(RETRY),--retry "$(RETRY)")

collect: set_up ## copy a lesson from the homes of a hub, for make grade: FROM=/home LESSON=02 TO=submissions_02
	@$(PYTHON) -m classroom.collect "$(FROM)" --lesson "$(LESSON)" $(if $(TO),--to "$(TO)")

syllabus: set_up ## write handout/syllabus.md from the lessons: goals, prerequisites, hours, weeks
	@$(PYTHON) -m classroom.kit.syllabus

exam: set_up ## draw robots with faults of a private folder, or judge: FAULTS= STUDENTS= SEED= FOLDER=; see classroom/UNIVERSITY.md
	@$(PYTHON) -m classroom.kit.exam --faults "$(FAULTS)" --students "$(STUDENTS)" --seed "$(SEED)" $(if $(FOLDER),--folder "$(FOLDER)")

hub: ## run a JupyterHub for a class: CONTAINERS=yes, SOLUTIONS=no, BORROW=no, HUB_ARGS=...; see classroom/HOSTING.md
	@classroom/hub/set_up.sh
	@CONTAINERS="$(CONTAINERS)" SOLUTIONS="$(SOLUTIONS)" BORROW="$(BORROW)" exec $(PYTHON) -m jupyterhub --config classroom/hub/jupyterhub_config.py $(HUB_ARGS)

image: ## build the container image of the lessons: SOLUTIONS=no, BORROW=no, BASE=, CONTAINER=, IMAGE_ARGS=
	@SOLUTIONS="$(SOLUTIONS)" BORROW="$(BORROW)" classroom/container/run.sh image

## Contribute

test: set_up ## test the course, each notebook against its saved outputs: LESSON=02 for one
	@answers="extend-exclude=[$$($(PYTHON) -m tools.lessons.answers)]" && \
		.venv/bin/ruff check --config "$$answers" && .venv/bin/ruff format --check --config "$$answers"
	@$(PYTHON) -m pytest -n $(WORKERS) --dist loadscope --max-worker-restart 0 $(lesson) $(PYTEST_ARGS)

notebooks: set_up ## run the notebooks whose code has changed, save outputs, tables, pictures: LESSON=02 for one, RUN=yes (new)
	@$(PYTHON) -m tools.lessons.run $(LESSON) $(if $(RUN),--run "$(RUN)")
	@$(PYTHON) -m tools.lessons.first_pictures

lesson: set_up ## begin a lesson: NAME=measure_the_delay, AFTER=04; REMOVE=yes takes it out
	@$(PYTHON) -m tools.lessons.new "$(NAME)" $(if $(AFTER),--after "$(AFTER)") $(if $(filter yes,$(REMOVE)),--remove)

task: set_up ## begin a task in a lesson: LESSON=02, AFTER=3, NAME=count_them
	@$(PYTHON) -m tools.lessons.task "$(LESSON)" $(if $(AFTER),--after "$(AFTER)") $(if $(NAME),--name "$(NAME)")

lint: set_up ## check style and format with ruff
	@.venv/bin/ruff check && .venv/bin/ruff format --check

test-ros2: set_up ## test the `ros2` command
	@$(PYTHON) -m pytest -n 2 --dist loadscope --max-worker-restart 0 -o faulthandler_timeout=600 ros2 $(PYTEST_ARGS)

test-tools: set_up ## test an installation from nothing, a new lesson, two machines, the rules of wrong answers
	@$(PYTHON) -m pytest -n 2 $(slow) tests/tools $(PYTEST_ARGS)

test-packages: set_up ## build and test the packages that learners end with: LESSON="09 12"
	@$(PYTHON) -m pytest -n 2 $(slow) tests/packages $(lesson) $(PYTEST_ARGS)

test-answers: set_up ## let each check judge the answers in tests/answers: LESSON=02, TASK=3, SEED=7 (of mutants)
	@$(PYTHON) -m pytest -n $(WORKERS) $(slow) tests/answers $(lesson) $(if $(TASK),--task "$(TASK)") $(if $(SEED),--seed "$(SEED)") $(PYTEST_ARGS)

mutants: set_up ## judge wrong answers that rules make: LESSON=05, TASK=2, SEED=7, COUNT=40 (all), JOBS=2, LIST=yes
	@$(PYTHON) tests/mutants --lesson "$(LESSON)" --task "$(TASK)" $(if $(SEED),--seed "$(SEED)") \
		$(if $(COUNT),--count "$(COUNT)") $(if $(JOBS),--jobs "$(JOBS)") $(if $(filter yes,$(LIST)),--list)

ordeal: set_up ## let each program that moves a robot meet troubles: LESSON=05, TASK=careful_brake, SEED=7, BASE=untimed, TROUBLE="scan: silent", COUNT=5, JOBS=2, WRITE=yes
	@$(PYTHON) tests/ordeal --lesson "$(LESSON)" --task "$(TASK)" --base "$(BASE)" --trouble "$(TROUBLE)" \
		$(if $(SEED),--seed "$(SEED)") $(if $(COUNT),--count "$(COUNT)") $(if $(JOBS),--jobs "$(JOBS)") $(if $(filter yes,$(WRITE)),--write)

test-browser: ## test JupyterLab and the site in Chromium
	@tools/set_up.sh browser && tools/set_up.sh site && $(PYTHON) -m tools.site
	@$(PYTHON) -m pytest -n 2 $(slow) tests/browser $(PYTEST_ARGS)

test-classroom: ## test slides, class page, handout, update and grading
	@tools/set_up.sh browser
	@$(PYTHON) -m pytest -n 2 $(slow) --ignore classroom/tests/hub --ignore classroom/tests/containers classroom/tests $(PYTEST_ARGS)

test-hub: set_up ## test a hub with a class of twelve, and its logins
	@tools/set_up.sh browser && tools/set_up.sh logins && { classroom/hub/set_up.sh || echo 'LEFT OUT: the hub.'; }
	@$(PYTHON) -m pytest -n 0 -rsP -o faulthandler_timeout=1200 classroom/tests/hub $(PYTEST_ARGS)

test-containers: set_up ## test the image, a class of twelve in containers, grading in containers, as root
	@tools/set_up.sh browser && { classroom/hub/set_up.sh || echo 'LEFT OUT: the hub.'; }
	@$(PYTHON) -m pytest -n 0 -rsP -o faulthandler_timeout=1200 classroom/tests/containers $(PYTEST_ARGS)

soak: set_up ## run the notebooks in hard conditions, as root: CONDITIONS="idle busy", LESSON=02
	@tests/soak/run.sh "$(CONDITIONS)" "$(LESSON)"

left-out: set_up ## run the notebooks with tasks left unsolved: TASKS=each (stars), LESSON=02
	@$(PYTHON) -m pytest -n $(WORKERS) --dist loadscope --max-worker-restart 0 -o faulthandler_timeout=600 tests/left_out notebooks \
		--left-out "$(or $(TASKS),stars)" $(lesson) $(PYTEST_ARGS)

bench: set_up ## measure what the first start costs, on an idle machine: ROUNDS=3
	@$(PYTHON) tests/benchmarks/start.py $(ROUNDS)

lock: ## write tools/locks from pyproject.toml: UPGRADE=yes takes newer versions
	@tools/lock.sh $(if $(filter yes,$(UPGRADE)),--upgrade)

licences: set_up ## list the licence that each installed package names
	@.venv/bin/pip-licenses --from=mixed --with-system --order=license
	@echo 'Unknown above, named in package.xml: the packages of ROS 2.'
	@sed -n 's/.*<license[^>]*>\([^<]*\).*/\1/p' .venv/share/*/package.xml | sort | uniq -c

release: set_up ## make handout, site and image of a tagged commit, and say what to publish
	@tools/release.sh

set_up:
	@tools/set_up.sh $(groups)

# What these commands need besides what a learner needs: groups of pyproject.toml.
test test-ros2 test-tools test-packages test-answers mutants ordeal test-browser test-classroom test-hub test-containers notebooks lesson task soak left-out bench lint: groups := test
test-browser test-classroom: set_up
licences: groups := test browser site hub logins licences

.PHONY: help lab present slides class test test-ros2 test-tools test-packages test-answers mutants ordeal test-browser test-classroom test-hub test-containers image lab-container hub handout grade collect syllabus exam update notebooks \
	lesson task site soak left-out bench release lint lock licences clean set_up

# Notebooks mostly wait, so more of them than cores run at once. A notebook stays in one worker. None
# is replaced: where one has crashed, pytest-xdist may wait for its successor for ever.
WORKERS := 4

# A lesson is named by its number or its name, everywhere: LESSON=02, LESSON=lose_messages, LESSON="02 03".
lesson = $(if $(LESSON),--lesson "$(LESSON)")

# Tests that start servers, browsers and compilers.
slow := --dist worksteal --max-worker-restart 0 -o faulthandler_timeout=600

this_python = $(shell $(PYTHON) -I -S -c 'import sys; print("%d.%d" % sys.version_info[:2])')

include tools/environment.mk
