"""How long does the interface package of lesson 07 build, and one with ten such interfaces?"""

from benchmarks.lessons import build, workspace_of
from benchmarks.table import Row, growth

PACKAGE, SERVICE = 'custom_interfaces', 'srv/TurnCamera.srv'
COUNTS = (1, 10)
ROUNDS = 3


def build_s(count: int) -> float:
    """Return the seconds of a build from nothing, with `count` copies of the service."""
    workspace = workspace_of('07', PACKAGE, name='interface')
    cmake, service = (
        workspace.file(f'src/{PACKAGE}/{name}').read_text() for name in ('CMakeLists.txt', SERVICE)
    )
    names = [SERVICE.replace('.', f'{number}.') for number in range(1, count)]
    for name in names:
        workspace.write(f'src/{PACKAGE}/{name}', service)
    listed = '\n'.join(f'"{name}"' for name in [SERVICE, *names])
    workspace.write(f'src/{PACKAGE}/CMakeLists.txt', cmake.replace(f'"{SERVICE}"', listed))
    return build(workspace, PACKAGE)


def measure() -> list[Row]:
    """Return the build of ten interfaces against that of one."""
    costs = {count: [build_s(count) for _ in range(ROUNDS)] for count in COUNTS}
    return growth('build a package of {} services', costs)
