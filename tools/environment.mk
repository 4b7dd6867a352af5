# What the commands of the repository and those of a handout share: the Makefile, and classroom/handout.mk.

PYTHON := .venv/bin/python

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
