"""This machine: what it has, lacks and refuses, the tools of a build, the folders of workspaces.

`doctor` is a door of its own, `python -m helpers.machine.doctor`: it runs where nothing else does.
"""

from helpers.machine.build_tools import Tool, build_environment, from_wheels, tools_of_a_build
from helpers.machine.folders import (
    BUILT,
    OWNED,
    Renamed,
    claim_workspace,
    files_of_person,
    give_new_names,
    locks_of_workspaces,
    name_beside,
    set_apart,
)
from helpers.machine.troubles import sentence_about

__all__ = [
    'BUILT',
    'OWNED',
    'Renamed',
    'Tool',
    'build_environment',
    'claim_workspace',
    'files_of_person',
    'from_wheels',
    'give_new_names',
    'locks_of_workspaces',
    'name_beside',
    'sentence_about',
    'set_apart',
    'tools_of_a_build',
]
