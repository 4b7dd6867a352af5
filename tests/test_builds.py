"""What checks say of builds that failed, and what they ask setup.py."""

import pytest

from helpers.checks.builds import build
from helpers.checks.errors import Failed
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
