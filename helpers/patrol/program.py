"""The program: its folder, its modules as they are now, its action, its route."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import yaml
from rclpy.parameter import Parameter

from helpers.workspace import Workspace

PACKAGE = 'src/patrol_pkg'
SIM = [Parameter('use_sim_time', value=True)]


def module(workspace: Workspace, name: str) -> ModuleType:
    """Import a module of the package as it is in src now."""
    sys.dont_write_bytecode = True  # two versions of a file within a second would share one
    folder = str(workspace.file(PACKAGE))
    sys.path[:] = [folder, *(path for path in sys.path if path != folder)]
    for known in [known for known in sys.modules if known.split('.')[0] == 'patrol_pkg']:
        del sys.modules[known]
    importlib.invalidate_caches()
    return importlib.import_module(f'patrol_pkg.{name}')


def action() -> type:
    """Return the learner's own action, which the lesson has built."""
    from patrol_interfaces.action import Patrol

    return Patrol


def route_of(path: Path) -> list[tuple[float, float]]:
    """Return the places of a parameter file: x, y (m, from the start)."""
    parameters = yaml.safe_load(path.read_text(encoding='utf-8'))
    (node,) = parameters.values()
    route = node['ros__parameters']['route']
    return list(zip(route[::2], route[1::2], strict=True))
