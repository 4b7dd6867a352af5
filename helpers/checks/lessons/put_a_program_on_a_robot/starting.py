"""What is installed, and what starts it."""

from rcl_interfaces.srv import GetParameters

from helpers.checks.bench import Bench
from helpers.checks.builds import build, builds, setup_is_whole
from helpers.checks.lessons.put_a_program_on_a_robot.shared import tasks
from helpers.checks.patrols import DRIVES, NOT_BUILT
from helpers.checks.points import all_of, cached, expect, needs
from helpers.checks.programs import Program
from helpers.patrol import LAUNCH, PACKAGE, launched, printed
from helpers.robot import ROOMS
from helpers.workspace import DIED, started


@tasks.add(limit_s=90)
def install_it(workspace):
    it_builds = cached(lambda: builds(workspace, 'patrol_pkg'))

    def has_programs():
        needs(it_builds, NOT_BUILT)
        said = workspace.terminal('source install/setup.bash\nros2 pkg executables patrol_pkg')
        lines = said.splitlines()
        programs = sorted(line.split()[-1] for line in lines if line.startswith('patrol_pkg '))
        return 'patrol' in programs or f'its programs: {", ".join(programs) or "none"}'

    def has_files():
        needs(it_builds, NOT_BUILT)
        # The launch file is the next task: here any file in its folder must be installed.
        launch_file = workspace.file(f'{PACKAGE}/launch/patrol.launch.xml')
        with workspace.replaced({f'{PACKAGE}/launch/planted.launch.xml': '<launch/>\n'}):
            workspace.build('patrol_pkg')
        share = workspace.file('install/patrol_pkg/share/patrol_pkg')
        wanted = ['config/rooms.yaml', 'launch/planted.launch.xml']
        wanted += ['launch/patrol.launch.xml'] if launch_file.exists() else []
        missing = [name for name in wanted if not (share / name).is_file()]
        if 'launch/planted.launch.xml' in missing:
            missing = [name for name in missing if not name.startswith('launch/')]
            missing += ['launch/planted.launch.xml, which the check has put into launch']
        return not missing or f'share/patrol_pkg has no {", no ".join(missing)}'

    def survives_pycache():
        needs(it_builds, NOT_BUILT)
        compiled = {f'{PACKAGE}/{name}/__pycache__/a.pyc': '' for name in ('launch', 'config')}
        with workspace.replaced(compiled):
            return builds(workspace, 'patrol_pkg')

    def wants_pytest():
        needs(it_builds, NOT_BUILT)
        return setup_is_whole(workspace, PACKAGE)

    files = "glob('launch/*launch.[pxy][yma]*') and glob('config/*.yaml')"
    return [
        ('it builds', it_builds, "entry_points={'console_scripts': [...]}"),
        ('the program', has_programs, "'patrol = patrol_pkg.main:main'"),
        ('its files', has_files, files),
        ('beside a __pycache__', survives_pycache, files),
        ('pytest', wants_pytest, "extras_require={'test': ['pytest']}"),
    ]


@tasks.add(limit_s=90, cpu_s=20)
def one_file_starts_it(workspace):
    def drives_in_step():
        build(workspace, 'patrol_pkg')
        share = 'install/patrol_pkg/share/patrol_pkg/config/'
        for floor in ('short', 'corridor'):
            text = 'patrol:\n  ros__parameters:\n    route: [1.0, 0.0]\n'
            workspace.write(f'{share}{floor}.yaml', text)
        arguments = 'floor:=short robot:=false sim:=true timeout:=60.0'
        robot, end = launched(workspace, arguments, ROOMS, 1, 8)
        way = robot.pose.x - ROOMS.start.x
        if end != 'SUCCEEDED':
            return end
        return 0.7 < way < 1.1 or f'its route is 1 m long in short.yaml, and it drove {way:.0f} m'

    def starts_both():
        for arguments, floor, wait_s in (
            ('', 'rooms', 0.3),
            ('floor:=corridor timeout:=0.7', 'corridor', 0.7),
        ):
            named = f'with {arguments or "no argument"}'
            text, sim, timeout_s = launched_with_robot(workspace, arguments)
            if DRIVES not in text:
                return f'{named} no robot drives. {printed(workspace, text.splitlines())}'
            if started(text) != ['patrol', 'robot']:
                return f'{named} it starts {" and ".join(started(text))}'
            if DIED in text:
                return f'{named} a program dies. {printed(workspace, text.splitlines())}'
            driven = text.partition(DRIVES)[2].partition('.')[0]
            of_patrol = f'{named} the parameter {{}} of the node patrol is'
            right = all_of(
                driven == floor or f'{named} the robot drives on the floor {driven}, not {floor}',
                expect(sim, False, of_patrol.format('use_sim_time')),
                expect(timeout_s, wait_s, of_patrol.format('timeout_s')),
            )
            if right is not True:
                return right
        return True

    hint = '<param from="$(dirname)/../config/$(var floor).yaml"/>'
    own = 'if="$(var robot)", $(var floor)'
    return [
        ('the program drives a robot that runs already', drives_in_step, hint),
        ('it starts its own robot on the floor', starts_both, own),
    ]


def launched_with_robot(workspace, arguments):
    """Launch the program and its own robot. Return what it prints, and two parameters of patrol.

    These, use_sim_time and timeout_s, are None if a program is missing or has died.
    """
    command = f'{LAUNCH}patrol.launch.xml {arguments}'
    answer = None
    with Bench() as bench, Program(workspace.start(command, 'both')) as both:
        bench.wait(lambda: both.says(DRIVES) or both.says(DIED) or not both.running, 20)
        if started('\n'.join(both.lines)) == ['patrol', 'robot'] and not both.says(DIED):
            request = GetParameters.Request(names=['use_sim_time', 'timeout_s'])
            answer = bench.call('/patrol/get_parameters', GetParameters, request, limit_s=10)
        text = '\n'.join(both.lines)
    if answer is None:
        return text, None, None
    sim, timeout = answer.values
    return text, sim.bool_value, timeout.double_value
