"""What checks say of builds that failed, what they ask setup.py, and what they give back."""

import os
from types import SimpleNamespace

import pytest

from helpers.checks.builds import build
from helpers.checks.errors import Failed
from helpers.trials import build_anew
from helpers.workspace import Workspace


@pytest.fixture
def package():
    workspace = Workspace('packages')
    workspace.write(
        'src/robot/package.xml',
        '<package format="3"><name>robot</name><version>0.0.0</version><description>A</description>'
        '<maintainer email="you@example.com">you</maintainer><license>MIT</license>'
        '<export><build_type>ament_python</build_type></export></package>',
    )
    workspace.write('src/robot/robot/__init__.py', '')
    yield workspace
    workspace.close()


def setup(workspace, arguments):
    text = f"from setuptools import setup\n\nsetup(name='robot', {arguments})\n"
    workspace.write('src/robot/setup.py', text)


def test_a_build_raises_the_first_error_and_can_begin_anew(package):
    package.write('src/robot/old.txt', 'Of an earlier try')
    setup(package, "packages=['robot'], data_files=[('share/robot', ['old.txt'])]")
    build(package, 'robot')
    setup(package, "packages=['robot'], data_files=[('share/robot', ['missing.txt'])]")
    old = package.file('install/robot/share/robot/old.txt')
    for anew in (False, True):
        with pytest.raises(Failed, match=r'robot: .*missing\.txt'):
            build(package, 'robot', anew=anew)
        assert old.exists() != anew


@pytest.mark.parametrize('asked', [['camera'], ['robot', 'camera']])
def test_a_package_that_is_not_there_is_named(package, asked):
    setup(package, "packages=['robot']")
    with pytest.raises(Failed, match='there is no package camera in src'):
        build(package, *asked)


@pytest.mark.parametrize(('since', 'is_back'), [(None, 'mine'), ('newer', 'newer')])
def test_a_check_that_was_killed_in_its_build_gives_the_file_back(tmp_path, since, is_back):
    cmake = tmp_path / 'src/scan_tools/CMakeLists.txt'
    cmake.parent.mkdir(parents=True)
    cmake.write_text('mine')

    def workspace_that(build):
        return SimpleNamespace(file=tmp_path.joinpath, build=build)

    worker = os.fork()
    if worker == 0:
        build_anew(workspace_that(lambda *_: os._exit(0)), library='ours')
    os.waitpid(worker, 0)
    assert cmake.read_text() == 'ours'
    if since:
        cmake.write_text(since)
    assert build_anew(workspace_that(lambda *_: cmake.read_text())) == is_back
    assert [*cmake.parent.iterdir()] == [cmake]
