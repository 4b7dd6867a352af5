"""What the tasks of the lesson "Bring in a package" are judged by."""

import math
import re

from helpers.checks.builds import builds
from helpers.checks.points import cached
from helpers.checks.programs import manifest, needed
from helpers.checks.tasks import Tasks
from helpers.trials import imports
from helpers.workspace import error_in, run_rosdep

tasks = Tasks()
check = tasks.check


@tasks.add
def clone_it(workspace, commands):
    def clone():
        """Run the commands with an empty src, unless it has a clone that was changed."""
        is_clone = 'test -d src/brake/.git && git -C src/brake remote -v | grep -q server/brake'
        printed = ''
        if not workspace.terminal(f'{is_clone} && git -C src/brake status --porcelain'):
            workspace.terminal('rm -rf src brake && mkdir src')
            printed = workspace.terminal(commands)
        if not workspace.file('src/brake/.git').is_dir():
            return ' '.join(['there is no clone src/brake.', *printed.splitlines()[-1:]])
        server = workspace.terminal('git -C src/brake remote get-url origin')
        return (
            server.removesuffix('.git').endswith('server/brake') or 'it is not of server/brake.git'
        )

    def is_jazzy():
        if not workspace.file('src/brake/.git').is_dir():
            return 'there is no clone'
        branch = workspace.terminal('git -C src/brake branch --show-current')
        return branch == 'jazzy' or f'it is on the branch {branch}'

    return [
        ('it is cloned into src', clone, 'git clone -b BRANCH ADDRESS'),
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
            return 'it names none at all'
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
    resolved = cached(
        lambda: resolve(workspace, rules, 'ubuntu:noble', 'opensuse:15.5', 'fedora:40')
    )

    def resolves(system, *wanted):
        lines = resolved()[system]
        names = [line for line in lines if not line.startswith('#')]
        return names == [*wanted] or f'rosdep: {lines[-1] if lines else "nothing"}'

    hint = 'A key with a colon; below it, two spaces, the system, a colon, and [the name].'
    numpy = 'python3-numpy'
    return [
        ('ubuntu', lambda: resolves('ubuntu:noble', numpy, 'python3-yaml'), hint),
        ('opensuse', lambda: resolves('opensuse:15.5', numpy, 'python3-PyYAML'), hint),
        ('fedora', lambda: resolves('fedora:40', numpy, 'python3-pyyaml'), hint),
    ]


@tasks.add(limit_s=90)
def build_what_you_need(workspace, commands):
    def leaves_gazebo_out():
        workspace.terminal(f'rm -rf build install log\n{commands}')
        return not workspace.file('build/brake_gazebo').exists() or 'colcon tried to build it'

    left_out = cached(leaves_gazebo_out)

    def is_built(module):
        # What else was built when a package failed, is chance.
        if left_out() is not True:
            return 'the build ends at brake_gazebo'
        return imports(workspace, module)

    hint = 'colcon build --packages-up-to NAME'
    finds = 'brake is built, and finds what it imports'
    return [
        ('brake_gazebo is left out', left_out, hint),
        (finds, lambda: is_built('brake.brake'), hint),
        ('brake_tools is built', lambda: is_built('brake_tools.speed'), hint),
    ]


@tasks.add(limit_s=90)
def install_the_files(workspace):
    built = cached(lambda: builds(workspace, 'brake'))

    def is_installed(file):
        if built() is not True:
            return 'it is not built'
        return workspace.file(f'install/brake/share/brake/{file}').is_file() or 'it is not there'

    pair = "One pair: ('share/' + package_name + '/FOLDER', ['FOLDER/FILE'])"
    commas = 'A comma after each pair. Paths start at the package folder.'
    config, start = 'config/brake.yaml', 'launch/brake.launch.xml'
    return [
        ('it builds', built, commas),
        ('config/brake.yaml is installed', lambda: is_installed(config), pair),
        ('the launch file is installed', lambda: is_installed(start), pair),
    ]


@tasks.add(limit_s=90)
def slow_down(workspace, links, change):
    file = 'src/brake/brake/config/brake.yaml'

    def installed():
        installed_file = workspace.file('install/brake/share/brake/config/brake.yaml')
        if not installed_file.is_file():
            return []
        return installed_file.read_text().partition('#')[0].split()

    def links_are_made():
        workspace.write(file, 'speed: 1.0')
        printed = workspace.terminal(f'rm -rf build/brake* install/brake*\n{links}')
        if 'Finished <<< brake' not in printed.splitlines():
            return 'brake is not built'
        workspace.write(file, 'speed: 0.5')
        if not installed():
            return 'config/brake.yaml is not installed'
        return installed() == ['speed:', '0.5'] or f'in src it is 0.5, in install {installed()[-1]}'

    linked = cached(links_are_made)

    def change_counts(before):
        if linked() == 'brake is not built':
            return linked()
        workspace.write(file, f'speed: {before}')
        workspace.terminal(change)
        return installed() == ['speed:', '0.3'] or f'installed is: {" ".join(installed())}'

    link_hint = 'colcon build --symlink-install ...'
    return [
        ('with LINKS, a change takes effect at once', linked, link_hint),
        ('CHANGE turns 1.0 into 0.3', lambda: change_counts('1.0'), "echo 'speed: 0.3' > FILE"),
        ('CHANGE turns 0.6 into 0.3', lambda: change_counts('0.6'), 'Write the whole file.'),
    ]


@tasks.add(limit_s=90)
def make_an_overlay(workspace, commands):
    def make():
        printed = workspace.terminal(f'rm -rf overlay\n{commands}')
        if not workspace.file('overlay/src').is_dir():
            return 'there is no folder overlay/src'
        names = 'colcon list --names-only --base-paths src 2>&1'
        packages = workspace.terminal(f'cd overlay && {names}')
        if packages == 'brake_tools':
            return True
        return f'its packages: {" ".join(packages.split()) or "none"}. {last_of(printed)}'.strip()

    made = cached(make)

    def is_hidden():
        count = workspace.terminal('colcon list --names-only 2>&1 | grep -c brake_tools')
        if not workspace.file('overlay').is_dir():
            return 'there is no folder overlay'
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
        ('it has brake_tools alone', made, 'cp -r src/brake/brake_tools overlay/src'),
        ('the underlay does not see it', is_hidden, 'touch overlay/COLCON_IGNORE'),
        ('its setup.bash finds both workspaces', has_both, 'source it before cd overlay'),
    ]


@tasks.add(limit_s=90)
def fix_the_function(workspace):
    built = cached(lambda: build_overlay(workspace))

    def returns(right, speed, *distances):
        if built() is not True:
            return built()
        lines = workspace.terminal(f"""
            source overlay/install/setup.bash
            python -c 'from math import nan; from brake_tools.speed import safe_speed
for distance in {distances}: print(float(safe_speed(distance, {speed})))'
        """).splitlines()
        if lines == [str(value) for value in right]:
            return True
        if any('Traceback' in line or 'Error: ' in line for line in lines):
            return error_in(lines)
        return f'{", ".join(lines[-5:])} for the distances {distances}'

    first, second = [0.0, 0.0, 0.4, 0.4, 0.8], [0.0, 0.5, 1.0]
    return [
        (
            'it is right for 0.8 m/s',
            lambda: returns(first, 0.8, 0.1, 0.49, 0.5, 0.99, 1.0),
            'Three returns, the nearest case first.',
        ),
        ('it is right for 1 m/s', lambda: returns(second, 1.0, 0.2, 0.8, 3.0), 'speed / 2'),
        (
            'it is 0.0 if the distance is NaN',
            lambda: returns([0.0], 1.0, math.nan),
            'NaN >= 0.5 is false, and so is NaN < 0.5. Which test does NaN pass by?',
        ),
    ]


@tasks.add
def create_a_package(workspace, commands):
    folder = 'overlay/src/speed_table'

    def create():
        printed = workspace.terminal(f'rm -rf {folder}\n{commands}')
        if workspace.file(folder).is_dir():
            return True
        return f'there is no folder {folder}. {last_of(printed)}'.strip()

    created = cached(create)

    def package():
        created()
        return manifest(workspace, folder)

    def is_of_python():
        kind = package().get_build_type()
        return kind == 'ament_python' or f'it is: {kind}'

    def has_license():
        return package().licenses[0] == 'Apache-2.0' or f'it is: {package().licenses[0]}'

    def needs_brake_tools():
        names = sorted(needed(package(), 'run'))
        return names == ['brake_tools'] or f'it needs: {", ".join(names) or "nothing"}'

    def has_executable():
        module = workspace.file(f'{folder}/speed_table/table.py')
        return module.is_file() or 'there is no speed_table/table.py'

    read = 'Run the text in a terminal, and read what it says.'
    return [
        ('the package is there', created, read),
        ('it is a Python package', is_of_python, '--build-type'),
        ('its license is Apache-2.0', has_license, '--license'),
        ('it needs brake_tools alone', needs_brake_tools, '--dependencies'),
        ('it has the executable table', has_executable, '--node-name'),
    ]


@tasks.add(limit_s=90)
def fill_it(workspace):
    def prints_speeds():
        built = build_overlay(workspace)
        if built is not True:
            return built
        run = 'source overlay/install/setup.bash\nros2 run speed_table table'
        lines = workspace.terminal(run).splitlines()
        if any('Traceback' in line for line in lines):
            return error_in(lines)
        return lines == ['0.0', '0.4', '0.8'] or f'the last lines are: {" | ".join(lines[-3:])}'

    printed = cached(prints_speeds)

    def asks_safe_speed():
        """Run it with a `safe_speed` that returns what it is asked."""
        printed()  # it builds
        lines = workspace.terminal("""
            source overlay/install/setup.bash
            python -c 'from brake_tools import speed
speed.safe_speed = lambda distance_m, speed: f"{distance_m:g} m at {speed:g} m/s"
from speed_table.table import main
main()'
        """).splitlines()
        if any('Traceback' in line for line in lines):
            return error_in(lines)
        right = ['0.4 m at 0.8 m/s', '0.8 m at 0.8 m/s', '2 m at 0.8 m/s']
        return lines == right or f'it asks: {" | ".join(lines[-3:])}'

    speed_hint = 'from brake_tools.speed import safe_speed'
    return [
        ('it prints 0.0, 0.4 and 0.8', printed, speed_hint),
        ('it asks safe_speed', asks_safe_speed, 'print(safe_speed(0.4, 0.8))'),
    ]


# --- rosdep


def resolve(workspace, rules, *systems):
    """Return what rosdep says of the two keys of `write_the_rules` on each system, as lines."""
    resolve_keys = 'rosdep resolve python3-numpy python3-yaml'
    commands = '; echo -----; '.join(f'{resolve_keys} --os={system}' for system in systems)
    parts = run_rosdep(workspace, rules, commands).split('-----\n')
    return {system: part.splitlines() for system, part in zip(systems, parts, strict=True)}


# --- What is built


def build_overlay(workspace):
    """Build the overlay in a terminal that has sourced the underlay. Return True, or the error."""
    build = 'cd overlay\ncolcon build --base-paths src 2>&1'
    printed = workspace.terminal(f'source install/setup.bash\n{build}')
    if re.search(r'Failed +<<<|Aborted', printed) is None:
        return True
    errors = re.findall(r'^\w*[Ee]rror: .*', printed, re.MULTILINE)
    return f'the build fails: {errors[0] if errors else last_of(printed)}'


def last_of(printed):
    """Return the last line that commands have printed."""
    return ([''] + printed.splitlines())[-1]
