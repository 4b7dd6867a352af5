"""The tools and the environment of a build."""

import os
import sys

import pytest
from support.packages import HOSTILE

from helpers.machine import build_tools as module
from helpers.machine.build_tools import build_environment, tools_of_a_build


@pytest.fixture
def hostile(monkeypatch) -> None:
    for name, value in HOSTILE.items():
        monkeypatch.setenv(name, value)


def missing() -> list[str]:
    return [tool.name for tool in tools_of_a_build() if not tool.found]


def test_hostile_variables_reach_no_build(hostile, monkeypatch):
    monkeypatch.setenv('LD_LIBRARY_PATH', f'{sys.prefix}/lib:/opt/ros/humble/lib:lib')
    monkeypatch.setenv('HTTPS_PROXY', 'proxy')
    seen = build_environment()
    assert not HOSTILE.items() & seen.items()
    assert HOSTILE.keys() & seen.keys() == {'AMENT_PREFIX_PATH'}
    assert seen['AMENT_PREFIX_PATH'] == sys.prefix
    assert seen['LD_LIBRARY_PATH'] == f'{sys.prefix}/lib'
    assert seen['HTTPS_PROXY'] == 'proxy'
    assert seen['PATH'].startswith(f'{os.path.dirname(sys.executable)}:')
    assert seen['VIRTUAL_ENV'] == sys.prefix
    assert seen['MAKEFLAGS'] == f'-j{len(os.sched_getaffinity(0))} -O'
    assert seen['LDFLAGS'] == '-Wl,--as-needed'


def test_colcon_finds_python_despite_a_space(monkeypatch):
    """Its setup.bash does not quote the folder."""
    assert 'COLCON_PYTHON_EXECUTABLE' not in build_environment()
    monkeypatch.setattr(sys, 'executable', '/my lessons/.venv/bin/python')
    assert build_environment()['COLCON_PYTHON_EXECUTABLE'] == sys._base_executable


def test_without_wheels_the_sourced_ros_stays(hostile, monkeypatch):
    monkeypatch.setattr(module, 'from_wheels', lambda: False)
    seen = build_environment()
    # The package `simulated_robot` is in the environment of this project.
    assert seen['AMENT_PREFIX_PATH'] == f'{HOSTILE["AMENT_PREFIX_PATH"]}:{sys.prefix}'
    kept = HOSTILE.items() & seen.items()
    assert {name for name, _ in kept} == {
        'CMAKE_PREFIX_PATH',
        'FASTDDS_BUILTIN_TRANSPORTS',
        'FASTRTPS_DEFAULT_PROFILES_FILE',
        'PYTHONPATH',
        'RMW_IMPLEMENTATION',
    }


def test_missing_tools_are_found(monkeypatch, tmp_path):
    assert missing() == []
    assert [tool.name for tool in tools_of_a_build(cmake=False)] == ['colcon']
    # CMake belongs to this Python.
    monkeypatch.setenv('PATH', str(tmp_path))
    (tmp_path / 'cc').symlink_to('/bin/sh')
    assert missing() == ['C++ compiler', 'make']
    monkeypatch.setenv('CXX', '/bin/sh')
    assert missing() == ['make']
    monkeypatch.setattr(module.sysconfig, 'get_path', lambda kind: '/nowhere')
    assert missing() == ['make', 'Python headers']
    python = f'python{sys.version_info.major}.{sys.version_info.minor}'
    assert tools_of_a_build()[-1].install == f'sudo apt install {python}-dev'
