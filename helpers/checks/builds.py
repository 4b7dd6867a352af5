"""What checks need for builds and packages: a build that fails says why."""

from __future__ import annotations

import shutil

from helpers.checks.errors import Failed
from helpers.workspace import BuildResult, Workspace, why_it_failed

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
