"""What the tasks of the lesson "Bring in a package" are judged by."""

import json
import math
import re
import shlex

from helpers.checks.builds import builds, setup_fits
from helpers.checks.errors import Failed
from helpers.checks.points import cached, expect, needs, rows
from helpers.checks.programs import manifest, needed
from helpers.checks.tasks import Tasks
from helpers.trials import imports
from helpers.workspace import error_in, first_error, run_rosdep

tasks = Tasks()
check = tasks.check


@tasks.add
def clone_it(workspace, commands):
    @cached
    def is_cloned():
        """Run the commands with an empty src, unless it has a clone that was changed."""
        is_clone = 'test -d src/brake/.git && git -C src/brake remote -v | grep -q server/brake'
        printed = ''
        if not workspace.terminal(f'{is_clone} && git -C src/brake status --porcelain'):
            workspace.terminal('rm -rf src brake && mkdir src')
            printed = workspace.terminal(commands)
        if not workspace.file('src/brake/.git').is_dir():
            return f'there is no clone src/brake. {last_of(printed)}'.strip()
        server = workspace.terminal('git -C src/brake remote get-url origin')
        is_right = server.removesuffix('.git').endswith('server/brake')
        return is_right or 'it is not of server/brake.git'

    def is_jazzy():
        needs(is_cloned, 'there is no clone')
        branch = workspace.terminal('git -C src/brake branch --show-current')
        return branch == 'jazzy' or f'it is on the branch {branch}'

    return [
        ('it is cloned into src', is_cloned, 'git clone -b BRANCH ADDRESS'),
        ('it is the branch of Jazzy', is_jazzy, 'The option -b takes a branch.'),
    ]


@tasks.add
def name_the_dependencies(workspace):
    of_ros = {'rclpy', 'geometry_msgs', 'sensor_msgs', 'ament_index_python', 'brake_tools'}
    keys = {'python3-numpy', 'python3-yaml'}
    given = {'ros2launch'}

    def names(moment):
        return needed(manifest(workspace, 'src/brake/brake'), moment)

    def named(wanted):
        missing = sorted(wanted - names('run'))
        return not missing or f'not named, or not to run: {", ".join(missing)}'

    def nothing_else():
        if not names('run') - given:
            raise Failed('it names none at all', hint='')
        others = sorted((names('run') | names('build')) - of_ros - keys - given)
        return not others or f'named, and not needed: {", ".join(others)}'

    def brake_tools_first():
        order = workspace.terminal('colcon list -t --names-only').split()
        if not {'brake_tools', 'brake'} <= {*order}:
            return f'colcon finds the packages {order}'
        return order.index('brake_tools') < order.index('brake') or f'the order is {order}'

    return [
        ('the packages of ROS are named', lambda: named(of_ros), 'One line for each import.'),
        ('the two system packages are named', lambda: named(keys), 'The keys are in the text.'),
        ('no other package is named', nothing_else, 'What is it needed for?'),
        ('brake_tools is built before brake', brake_tools_first, 'Name it as in the import.'),
    ]


@tasks.add
def write_the_rules(workspace, rules):
    systems = 'ubuntu:noble', 'opensuse:15.5', 'fedora:40'

    @cached
    def resolved():
        """Return the lines that rosdep says of the two keys, for each system."""
        keys = 'rosdep resolve python3-numpy python3-yaml'
        commands = '; echo -----; '.join(f'{keys} --os={system}' for system in systems)
        parts = run_rosdep(workspace, rules, commands).split('-----\n')
        return dict(zip(systems, map(str.splitlines, parts), strict=True))

    def resolves(system, *wanted):
        lines = resolved()[system]
        names = [line for line in lines if not line.startswith('#')]
        return names == [*wanted] or f'rosdep: {lines[-1] if lines else "nothing"}'

    return rows(
        resolves,
        'A key with a colon; below it, two spaces, the system, a colon, and [the name].',
        ('ubuntu', 'ubuntu:noble', 'python3-numpy', 'python3-yaml'),
        ('opensuse', 'opensuse:15.5', 'python3-numpy', 'python3-PyYAML'),
        ('fedora', 'fedora:40', 'python3-numpy', 'python3-pyyaml'),
    )


@tasks.add(limit_s=90)
def build_what_you_need(workspace, commands):
    built = cached(lambda: workspace.terminal(f'rm -rf build install log\n{commands}'))

    @cached
    def left_out():
        printed = built()
        if not workspace.file('build').is_dir():
            raise Failed(f'colcon builds nothing. {last_of(printed)}'.strip(), hint='')
        return not workspace.file('build/brake_gazebo').exists() or 'colcon tried to build it'

    def is_built(module):
        if workspace.file('build/brake_gazebo').exists():
            # What else was built when a package failed, is chance.
            needs(left_out, 'the build ends at brake_gazebo')
        needs(left_out)
        found = imports(workspace, module)
        return found is True or first_error(built()) or found

    hint = 'colcon build --packages-up-to NAME'
    finds = 'brake is built, and finds what it imports'
    return [
        ('brake_gazebo is left out', left_out, hint),
        (finds, lambda: is_built('brake.brake'), hint),
        ('brake_tools is built', lambda: is_built('brake_tools.speed'), hint),
    ]


@tasks.add(limit_s=90)
def install_the_files(workspace):
    # With what it needs, which is not there if the task before was not solved.
    built = cached(lambda: builds(workspace, 'brake_tools', 'brake'))

    def is_installed(file):
        needs(built, 'it is not built')
        return workspace.file(f'install/brake/share/brake/{file}').is_file() or 'it is not there'

    pair = "One pair: ('share/' + package_name + '/FOLDER', ['FOLDER/FILE'])"
    commas = 'A comma after each pair. Paths start at the package folder.'
    files = rows(
        is_installed,
        pair,
        ('config/brake.yaml is installed', 'config/brake.yaml'),
        ('the launch file is installed', 'launch/brake.launch.xml'),
    )
    given = 'The lines that were there stay.'

    def fits():
        if not workspace.file('install/brake/lib/brake/brake').exists():
            return 'ros2 run finds no program in it: entry_points does not name it'
        return setup_fits(workspace, 'src/brake/brake')

    return [('it builds', built, commas), *files, ('it says what package.xml says', fits, given)]


@tasks.add(limit_s=90)
def slow_down(workspace, links, change):
    file = 'src/brake/brake/config/brake.yaml'
    given = 'speed: 1.0\n'  # as the colleague has written it

    def installed():
        installed_file = workspace.file('install/brake/share/brake/config/brake.yaml')
        if not installed_file.is_file():
            return []
        return installed_file.read_text().partition('#')[0].split()

    @cached
    def is_built():
        workspace.write(file, given)
        printed = workspace.terminal(f'rm -rf build/brake* install/brake*\n{links}')
        return 'Finished <<< brake' in printed.splitlines() or 'brake is not built'

    def is_linked():
        needs(is_built)
        with workspace.replaced({file: 'speed: 0.5'}):
            found = installed()
        if not found:
            return 'config/brake.yaml is not installed'
        return found == ['speed:', '0.5'] or f'in src it is 0.5, in install {found[-1]}'

    def changes():
        needs(is_built)
        workspace.terminal(change)
        if installed() == ['speed:', '0.3']:
            return True  # and the robot drives with it
        found = f'installed is: {" ".join(installed())}'
        workspace.write(file, given)
        return found

    link_hint = 'colcon build --symlink-install ...'
    return [
        ('with LINKS, a change takes effect at once', is_linked, link_hint),
        ('CHANGE turns 1.0 into 0.3', changes, "echo 'speed: 0.3' > FILE"),
    ]


@tasks.add(limit_s=90)
def make_an_overlay(workspace, commands):
    def has_one_package():
        printed = workspace.terminal(f'rm -rf overlay\n{commands}')
        if not workspace.file('overlay/src').is_dir():
            return 'there is no folder overlay/src'
        names = 'colcon list --names-only --base-paths src 2>&1'
        packages = workspace.terminal(f'cd overlay && {names}').split()
        if packages == ['brake_tools']:
            return True
        return f'its packages: {" ".join(packages) or "none"}. {last_of(printed)}'.strip()

    def is_hidden():
        if not workspace.file('overlay').is_dir():
            return 'there is no folder overlay'
        count = workspace.terminal('colcon list --names-only 2>&1 | grep -c brake_tools')
        return count == '1' or f'the underlay finds brake_tools {count} times'

    def has_both():
        file = 'overlay/install/setup.bash'
        if not workspace.file(file).is_file():
            return f'there is no {file}'
        prefixes = 'ros2 pkg prefix brake_tools\nros2 pkg prefix brake'
        folders = workspace.terminal(f'source {file}\n{prefixes}').splitlines()
        right = ['overlay/install/brake_tools', 'install/brake']
        return folders == right or f'found: {", ".join(folders)}'

    return [
        ('it has brake_tools alone', has_one_package, 'cp -r src/brake/brake_tools overlay/src'),
        ('the underlay does not see it', is_hidden, 'touch overlay/COLCON_IGNORE'),
        ('its setup.bash finds both workspaces', has_both, 'source it before cd overlay'),
    ]


AS_BRAKE = """
import json
from math import nan
from brake_tools.speed import nearest_ahead, safe_speed

def drive(distance):
    return float(safe_speed(nearest_ahead([distance] * 181), SPEED))

print('\\nspeeds:', json.dumps([drive(distance) for distance in DISTANCES]))
"""


@tasks.add(limit_s=90)
def fix_the_function(workspace):
    built = cached(lambda: build_overlay(workspace))

    def returns(right, speed, *distances):
        """Ask for a speed as brake does, which looks for the nearest distance first."""
        needs(built)
        code = AS_BRAKE.replace('SPEED', str(speed)).replace('DISTANCES', str([*distances]))
        lines = run_in_overlay(workspace, code)
        said = [line for line in lines if line.startswith('speeds: ')]
        if not said:
            raise Failed(error_in(lines), hint='')
        found = json.loads(said[-1].removeprefix('speeds: '))
        return expect(found, right, f'for the distances {[*distances]} it returns')

    first, second = [0.0, 0.0, 0.4, 0.4, 0.8], [0.0, 0.5, 1.0]
    order = 'Three returns, the nearest case first.'
    not_a_number = 'NaN >= 0.5 is false, and so is NaN < 0.5. Which test does NaN pass by?'
    return [
        ('it is right for 0.8 m/s', lambda: returns(first, 0.8, 0.1, 0.49, 0.5, 0.99, 1.0), order),
        ('it is right for 1 m/s', lambda: returns(second, 1.0, 0.2, 0.8, 3.0), 'speed / 2'),
        ('it is 0.0 if the distance is NaN', lambda: returns([0.0], 1.0, math.nan), not_a_number),
    ]


# --- The overlay


def build_overlay(workspace):
    """Build the overlay in a terminal that has sourced the underlay. Return True, or the error."""
    build = 'cd overlay\ncolcon build --base-paths src 2>&1'
    printed = workspace.terminal(f'source install/setup.bash\n{build}')
    if re.search(r'Failed +<<<|Aborted', printed):
        raise Failed(f'the build fails: {error_in(printed)}', hint='')
    return True


def run_in_overlay(workspace, code):
    """Run Python in a terminal that has sourced the overlay. Return the lines that it prints."""
    run = f'python -c {shlex.quote(code)}'
    return workspace.terminal(f'source overlay/install/setup.bash\n{run}').splitlines()


def last_of(printed):
    """Return the last line that commands have printed."""
    return ([''] + printed.splitlines())[-1]
