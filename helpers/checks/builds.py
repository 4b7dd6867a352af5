"""What checks need for builds and packages: a build that fails says why."""

from __future__ import annotations

import json
import shutil

from helpers.checks.errors import Failed
from helpers.checks.programs import manifest
from helpers.workspace import BuildResult, Workspace, error_in, why_it_failed

# In what the assertion of the standard library of C++ prints, if the value of an empty optional is
# read. A judge builds with _GLIBCXX_ASSERTIONS.
EMPTY_OPTIONAL = 'is_engaged()'


def build(workspace: Workspace, *packages: str, anew: bool = False) -> BuildResult:
    """Build packages. Raises Failed with the first error of the build.

    A build takes nothing away, so that what an earlier try has installed stays. With `anew`, the
    installed files and the build folders of these packages are removed before.
    """
    if anew:
        for package in packages:
            for folder in ('build', 'install'):
                shutil.rmtree(workspace.file(f'{folder}/{package}'), ignore_errors=True)
    result = workspace.build(*packages)
    if not result.ok:
        raise Failed(why_it_failed(result))
    return result


def builds(workspace: Workspace, *packages: str, anew: bool = True) -> bool | str:
    """Build packages. Return True, or the first error. A warning of colcon counts as one."""
    try:
        result = build(workspace, *packages, anew=anew)
    except Failed as error:
        return str(error)
    return not result.warnings or ' '.join(result.warnings[-1].split())


WHAT_SETUP_SAYS = """
import json
from distutils.core import run_setup

said = run_setup('setup.py', stop_after='init')
names = 'name', 'version', 'maintainer', 'maintainer_email', 'description', 'license'
print('\\n' + json.dumps({
    'data_files': [[folder, [*files]] for folder, files in said.data_files or []],
    'extras_require': {key: [*value] for key, value in (said.extras_require or {}).items()},
    **{name: getattr(said.metadata, name) for name in names},
}))
"""


def setup_of(workspace: Workspace, folder: str) -> dict:
    """Return what the setup.py in a folder says of its package, and its data_files.

    The keys are those of `setup(...)`. Raises Failed with its error if it cannot be read.
    """
    workspace.write('.setup_of.py', WHAT_SETUP_SAYS)
    command = f'cd {folder}; python -W ignore "$OLDPWD/.setup_of.py" 2>&1'
    lines = workspace.terminal(command).splitlines() or ['']
    if not lines[-1].startswith('{'):
        raise Failed(f'setup.py cannot be read: {error_in(lines)}', hint='')
    return json.loads(lines[-1])


def setup_is_whole(workspace: Workspace, folder: str) -> bool | str:
    """Return whether a setup.py says of its package all that it should, or what it does not say."""
    said = setup_of(workspace, folder)
    tests = said.pop('extras_require').get('test', [])
    missing = [name for name, value in said.items() if value in (None, 'UNKNOWN')]
    if missing:
        return f'setup() does not say its {" and its ".join(missing)}'
    return 'pytest' in tests or "extras_require does not name pytest for 'test'"


def setup_fits(workspace: Workspace, folder: str) -> bool | str:
    """Return whether a setup.py says what the package.xml beside it says, or where they differ."""
    said, package = setup_of(workspace, folder), manifest(workspace, folder)
    [person, *_] = package.maintainers
    right = {
        'name': package.name,
        'version': package.version,
        'maintainer': person.name,
        'maintainer_email': person.email,
        'description': package.description,
        'license': package.licenses[0],
    }
    for key, value in right.items():
        if said[key] != value:
            return f'{key} is {said[key]} in setup.py and {value} in package.xml'
    share = f'share/{package.name}'
    index = 'share/ament_index/resource_index/packages'
    for target, file in ((index, f'resource/{package.name}'), (share, 'package.xml')):
        if not any(
            where.rstrip('/') == target and file in files for where, files in said['data_files']
        ):
            return f'data_files does not install {file} in {target}'
    tests = [depend.name for depend in package.test_depends]
    if 'python3-pytest' in tests and 'pytest' not in said['extras_require'].get('test', []):
        return "extras_require does not name pytest for 'test', and colcon test finds no tests"
    return True
