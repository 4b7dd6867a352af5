"""What runs as a program loads no more than it needs: each start of a robot would wait for it.

Beside those of rclpy there are 380 to 400 modules: numpy, rclpy's actions, and types of messages.
With tables, pictures and replays there would be 840.
"""

import json
import subprocess
import sys

import pytest

HEAVY = {'IPython', '_quickjs', 'ipywidgets', 'matplotlib', 'pandas', 'quickjs'}
MOST_MODULES = 450
NEW_MODULES = """
import importlib, json, rclpy, sys
before = {*sys.modules}
importlib.import_module(sys.argv[1])
print(json.dumps(sorted({*sys.modules} - before)))
"""


@pytest.mark.parametrize(
    'module',
    [
        'helpers.robot',
        'helpers.robot.__main__',  # ros2 run simulated_robot robot
        'helpers.robot.state_publisher',  # ros2 run robot_state_publisher robot_state_publisher
        'helpers.fusion',
        'helpers.fusion.__main__',  # ros2 run robot_localization ekf_node
    ],
)
def test_a_program_loads_no_tables_pictures_or_replays(module):
    command = [sys.executable, '-c', NEW_MODULES, module]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    loaded = json.loads(done.stdout)
    assert module in loaded
    assert HEAVY.intersection(loaded) == set()
    assert len(loaded) <= MOST_MODULES


@pytest.mark.parametrize('module', ['helpers.checks', 'helpers.robot_view', 'helpers.replay'])
def test_a_first_cell_loads_no_tables(module):
    command = [sys.executable, '-c', NEW_MODULES, module]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert {'matplotlib', 'pandas'}.intersection(json.loads(done.stdout)) == set()
