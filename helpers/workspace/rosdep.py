"""rosdep with rules of a lesson, and no list from the network."""

from __future__ import annotations

from helpers.workspace.workspace import Workspace


def rosdep(workspace: Workspace, words: str, rules: str) -> list[str]:
    """Run rosdep with these rules, and no others. Return its lines, its commands sorted.

    It writes its commands in any order.
    """
    lines = run_rosdep(workspace, rules, f'rosdep {words}').splitlines()
    steps = sorted(line for line in lines if line.startswith('  '))
    return [line for line in lines if not line.startswith('  ')] + steps


def run_rosdep(workspace: Workspace, rules: str, commands: str) -> str:
    """Run commands of rosdep, which reads these rules, a YAML file. Return what they print."""
    index = '%YAML 1.1\n---\ndistributions: {}\ntype: index\nversion: 4\n'
    workspace.write('rosdep/index-v4.yaml', index)
    workspace.write('rosdep/my.list', f'yaml file://{workspace.path}/rosdep/python.yaml\n')
    workspace.write('rosdep/python.yaml', rules)
    update = 'rosdep update > rosdep/log 2>&1 || cat rosdep/log'
    said = workspace.terminal(f"""
        export ROSDEP_SOURCE_PATH=$PWD/rosdep ROS_HOME=$PWD/rosdep/home ROS_DISTRO=jazzy
        export ROSDISTRO_INDEX_URL=file://$PWD/rosdep/index-v4.yaml ROS_PYTHON_VERSION=3
        ({update}; {commands}) 2>&1""")
    return said.replace('sudo -H ', '')
