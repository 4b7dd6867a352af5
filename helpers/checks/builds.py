"""What checks need for builds and packages: a build, and why it failed."""

from __future__ import annotations

import re
import shutil

from helpers.checks.errors import Failed
from helpers.checks.first_error import error_of_build
from helpers.workspace import BuildResult, Workspace


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


def why_it_failed(result: BuildResult) -> str:
    """Return the package of a build that failed, and its first error: what, file, line."""
    if result.ok:
        return 'nothing: the build has finished'
    said = ' '.join([*result.errors, *result.warnings])
    unknown = re.findall(r"ignoring unknown package '(.+?)'", said)  # which ends no build
    if unknown and not result.failed:
        return f'there is no package {unknown[0]} in src: has it a package.xml?'
    error = error_of_build(result.errors)
    return f'{result.failed}: {error}' if result.failed else error
