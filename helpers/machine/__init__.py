"""This machine: what it has, what is missing, and the tools with which a package is built.

`doctor` is a door of its own, `python -m helpers.machine.doctor`: it runs where nothing else does.
"""

from helpers.machine.build_tools import Tool, build_environment, from_wheels, tools_of_a_build

__all__ = ['Tool', 'build_environment', 'from_wheels', 'tools_of_a_build']
