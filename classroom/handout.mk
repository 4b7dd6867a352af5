# The Makefile of a handout. `make help` lists the commands. environment.md says what is installed, and why.

help: ## show this list. Capitals are options: make lab PORT=8890
	@sed -n 's/^\([a-z0-9-]*\):.*## /  make \1	/p' Makefile | expand -t 23

lab: set_up ## open JupyterLab on the first notebook: PORT=8890, BROWSER=no
	@exec $(PYTHON) -m tools.lab $(server) -- $(LAB_ARGS)

update: set_up ## bring newer lessons, keep what you have written: FROM=ros2_notebooks.tar.gz
	@$(PYTHON) -m classroom.update $(if $(FROM),"$(FROM)") && tools/set_up.sh

set_up:
	@tools/set_up.sh

.PHONY: help lab update set_up

include tools/environment.mk
