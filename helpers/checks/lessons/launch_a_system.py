"""What the tasks of the lesson "Launch a system" are judged by."""

import contextlib
import os
import re
import signal
import time

from helpers.checks.builds import builds
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, needs
from helpers.checks.programs import Program, launch, manifest, needed
from helpers.checks.tasks import Tasks
from helpers.workspace import error_of_launch, first_error, started, wait_until

tasks = Tasks()
check = tasks.check

ROBOT_AND_DRIVER = 'drives on the floor corridor', '[driver]: I drive at 0.4 m/s'
IMPORTED = 'geometry_msgs', 'rclpy', 'sensor_msgs', 'std_srvs'
OWN_SPEEDS = '[one.driver]: I drive at 0.3 m/s', '[two.driver]: I drive at 0.6 m/s'


@tasks.add(limit_s=60, own_domain=True)
def one_file(workspace, file):
    text = cached(lambda: run(workspace, file, *ROBOT_AND_DRIVER, programs=2))
    hint = '<node pkg=... exec="driver">, in it <param name=... value=.../>, and then </node>.'
    return [
        ('the driver drives the robot at 0.4 m/s', lambda: says(text(), *ROBOT_AND_DRIVER), hint),
        ('two programs are started', lambda: starts(text(), 'driver', 'robot'), 'Each once.'),
    ]


@tasks.add(limit_s=60, own_domain=True)
def the_same_in_yaml(workspace, file):
    text = cached(lambda: run(workspace, file, *ROBOT_AND_DRIVER, programs=2))
    hint = 'Below "param:" write "- name: speed", and below "name" write "value: 0.4".'
    each = '- node: for each.'
    return [
        ('the driver drives the robot at 0.4 m/s', lambda: says(text(), *ROBOT_AND_DRIVER), hint),
        ('two programs are started', lambda: starts(text(), 'driver', 'robot'), each),
    ]


@tasks.add(limit_s=60, own_domain=True)
def a_file_for_all_floors(workspace, file):
    @cached
    def declared():
        said = workspace.terminal(f'ros2 launch -s {file}')
        pairs = dict(re.findall(r"'(\w+)':\*?\n.*\n *\(default: '(.*)'\)", said))
        if pairs == {'floor': 'corridor', 'speed': '0.4', 'driver': 'true'}:
            return True
        if 'Arguments (' not in said:
            return said.splitlines()[-1]
        return f'the arguments with a default are {pairs or "none"}'

    def launched(arguments, *lines, programs):
        needs(declared, 'they are not declared as the task says')
        return run(workspace, f'{file} {arguments}', *lines, programs=programs)

    def starts_without():
        text = launched('', *ROBOT_AND_DRIVER, programs=2)
        if started(text) == ['robot']:
            return 'only the robot is started: with driver:=true the driver must start'
        return says(text, *ROBOT_AND_DRIVER)

    def passes_on():
        lines = 'on the floor empty', 'I drive at 0.2 m/s'
        return says(launched('floor:=empty speed:=0.2', *lines, programs=2), *lines)

    def drives_by_hand():
        text = launched('driver:=false floor:=rooms', 'on the floor rooms', programs=1)
        return all_of(says(text, 'on the floor rooms'), starts(text, 'robot'))

    by_hand = 'with driver:=false only the robot starts'
    return [
        ('it declares three arguments', declared, '<arg name=... default=.../>, three times.'),
        ('without arguments it starts as before', starts_without, 'if="$(var driver)"'),
        ('floor and speed reach the programs', passes_on, '$(var floor) in place of the word.'),
        (by_hand, drives_by_hand, 'if="..." belongs to the node.'),
    ]


@tasks.add(limit_s=60, own_domain=True)
def one_robot_with_a_name(workspace, file):
    speed = 'I drive at 0.25 m/s'
    lines = 'floor corridor', f'[ada.driver]: {speed}', f'[bo.driver]: {speed}'

    @cached
    def text():
        """Launch it in another folder, with other parameters, as two robots."""
        include = (
            '<include file="$(dirname)/one.launch.xml"><arg name="name" value="{}"/></include>'
        )
        both = f'<launch>{include.format("ada")}{include.format("bo")}</launch>'
        workspace.write('.tried/launch/one.launch.xml', workspace.file(file).read_text())
        workspace.write('.tried/launch/two.launch.xml', both)
        workspace.write('.tried/config/driver.yaml', '/**: {ros__parameters: {speed: 0.25}}')
        return run(workspace, '.tried/launch/two.launch.xml', *lines, programs=4)

    def drives():
        other_speed = 'I drive at' in text() and speed not in text()
        return says(text(), *lines, hint=parameters if other_speed else None)

    hint = '<group>, push_ros_namespace with $(var name), and only then the two nodes.'
    parameters = 'In the driver: <param from="$(dirname)/../config/driver.yaml"/>.'
    both = ['driver', 'robot'] * 2
    return [
        ('each driver has a robot, and the parameters', drives, hint),
        ('a robot and a driver, each once', lambda: starts(text(), *both), hint),
    ]


@tasks.add(limit_s=60, own_domain=True)
def two_robots(workspace, file):
    lines = [f'[{name}.driver]: I drive' for name in ('one', 'two')]
    text = cached(lambda: run(workspace, file, *lines, programs=4))
    hint = '<include file="$(dirname)/...">, <arg name="name" value="one"/>, </include>; twice.'
    both = ['driver', 'robot'] * 2
    return [
        ('each of two robots has its driver', lambda: says(text(), *lines), hint),
        ('nothing else is started', lambda: starts(text(), *both), 'Two includes.'),
    ]


@tasks.add(limit_s=60, own_domain=True)
def a_speed_for_each(workspace, file):
    def own_speeds():
        return says(run(workspace, file, *OWN_SPEEDS, programs=4), *OWN_SPEEDS)

    hint = 'The key is the full name, such as /one/driver.'
    return [('each robot has its speed', own_speeds, hint)]


@tasks.add(limit_s=60, own_domain=True)
def start_it_again(workspace, file):
    def comes_back():
        log, text = guarded(workspace, f'{file} speed:=0.4', kill=True)
        starts_s, died_s = times(log, 'process started'), times(log, 'has died')
        if not starts_s:
            return error_of_launch(text) or 'no program is started'
        if len(starts_s) != 2:
            return 'it was killed, and is not started again'
        return starts_s[1] - died_s[0] > 0.45 or 'it is started again at once'

    def gives_up():
        log, text = guarded(workspace, f'{file} speed:=fast')
        starts_s = times(log, 'process started')
        if not starts_s:
            return error_of_launch(text) or 'no program is started'
        often = {1: 'once', 2: 'twice'}.get(len(starts_s), 'again and again')
        return len(starts_s) == 3 or f'with speed:=fast it is started {often}'

    hint = 'respawn_max_retries counts the starts after the first one.'
    return [
        ('a driver that is killed comes back after 0.5 s', comes_back, 'respawn and respawn_delay'),
        ('launch gives up after two more tries', gives_up, hint),
    ]


SILENT = """import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import Trigger


async def never(request, response):
    print('asked', flush=True)
    await Future()


rclpy.init()
node = rclpy.create_node('silent')
group = ReentrantCallbackGroup()  # a second request is counted, too
node.create_service(Trigger, 'camera/turn_left', never, callback_group=group)
rclpy.spin(node)
"""


@tasks.add(limit_s=120, own_domain=True)
def a_camera_that_waits(workspace):
    def start(words, name):
        run = f'source install/setup.bash\n{words} --ros-args -r __ns:=/{name}'
        return Program(workspace.start(run, f'{words} in {name}'))

    def start_camera(name):
        return start('ros2 run fleet_pkg camera', name)

    @cached
    def tried():
        """Try both at once, because the second one waits for 5 s. Return the two results."""
        workspace.write('.tried/silent.py', SILENT)
        with (
            start('exec python3 .tried/silent.py', 'silent') as silent,
            start_camera('silent') as camera,
        ):
            tests = cached(waits_and_turns), cached(lambda: gives_up(camera, silent))
            for test in tests:
                with contextlib.suppress(Failed):
                    test()
        return tests

    def waits_and_turns():
        """Start it before the robot, and a second time after it."""
        with start_camera('tried') as camera:

            def has_waited():
                return sum('I wait for' in line for line in camera.lines) >= 3

            wait_until(lambda: has_waited() or not camera.running, 12)
            if not camera.running:
                raise ended('before there is a robot it ends', camera)
            if not has_waited():
                return 'before there is a robot it does not say again and again that it waits'
            begun_s = time.monotonic()
            with start('ros2 run simulated_robot robot', 'tried') as robot:
                wait_until(lambda: robot.says('drives on'), 25)
                # A slow machine gets more time.
                limit_s = max(4.0, 3 * (time.monotonic() - begun_s))
                turned = turns(camera, limit_s)
                if turned is not True:
                    return turned
                with start_camera('tried') as late:
                    return turns(late, limit_s)

    hint = 'while not self.client.wait_for_service(timeout_sec=1.0): log. Only then call_async.'
    late = 'After timeout_sec=5.0, future.done() says whether the answer has come.'
    return [
        ('it turns the camera, whichever starts first', lambda: tried()[0](), hint),
        ('it asks once, and gives up if no answer comes', lambda: tried()[1](), late),
    ]


@tasks.add(limit_s=90, own_domain=True)
def install_the_files(workspace):
    @cached
    def built():
        workspace.terminal('rm -rf build install')
        # As a launch file in Python leaves it.
        workspace.write('src/fleet_pkg/launch/__pycache__/robot.launch.pyc', '')
        return builds(workspace, 'fleet_pkg')

    def is_installed():
        needs(built, 'it is not built')
        share = workspace.file('install/fleet_pkg/share/fleet_pkg')
        source = workspace.file('src/fleet_pkg')
        files = [*source.glob('launch/*.launch.*'), *source.glob('config/*.yaml')]
        wanted = sorted(file.relative_to(source).as_posix() for file in files)
        absent = [file for file in wanted if not (share / file).is_file()]
        return not absent or f'share/fleet_pkg has no {", no ".join(absent)}'

    def is_launched():
        needs(built, 'it is not built')
        words = 'fleet_pkg two_robots.launch.xml'
        try:
            return says(run(workspace, words, *OWN_SPEEDS, programs=4), *OWN_SPEEDS)
        finally:  # as the lesson has built it: links to the code
            workspace.terminal('rm -rf build install')
            workspace.build('fleet_pkg', symlink_install=True)

    hint = "('share/' + package_name + '/launch', glob('launch/*launch.[pxy][yma]*'))"
    both = f'{hint}, and the same for config'
    return [
        ('it builds', built, hint),
        ('launch files and parameters are installed', is_installed, both),
        ('ros2 launch fleet_pkg two_robots.launch.xml', is_launched, 'Is it installed?'),
    ]


@tasks.add
def name_what_it_starts(workspace):
    def package():
        return manifest(workspace, 'src/fleet_pkg')

    def is_described():
        text = package().description
        return 'TODO' not in text or f'its description is: {text}'

    def names(*wanted):
        missing = sorted({*wanted} - needed(package(), 'run'))
        return not missing or f'not named, or not to run: {", ".join(missing)}'

    def names_no_other():
        known = {*IMPORTED, 'simulated_robot', 'ros2launch'}
        others = sorted((needed(package(), 'run') | needed(package(), 'build')) - known)
        return not others or f'named, and not needed: {", ".join(others)}'

    robot = 'The word after pkg= in your launch files, if it is not your own package.'
    line = '<exec_depend>NAME</exec_depend>'
    return [
        ('it says what it is', is_described, 'Write it into <description>.'),
        ('the package of the robot is named', lambda: names('simulated_robot'), robot),
        ('what reads the launch files is named', lambda: names('ros2launch'), line),
        ('what the code imports is named', lambda: names(*IMPORTED), 'Keep the four lines.'),
        ('no other package is named', names_no_other, 'What is it needed for?'),
    ]


# --- What a launch prints


class Patience:
    """Says when nothing more comes: after 4 s of silence, on a slow machine after more.

    How slow it is, the first program has shown: what its start took, others may take twice.
    """

    def __init__(self):
        self._begun_s = self._since_s = time.monotonic()
        self._start_s = None
        self._text = ''

    def is_over(self, has_started, text):
        """Return whether the text has been the same for too long since the first start."""
        now_s = time.monotonic()
        if has_started and self._start_s is None:
            self._start_s = now_s - self._begun_s
        if text != self._text:
            self._text, self._since_s = text, now_s
        return has_started and now_s - self._since_s > max(4.0, 2 * self._start_s)


def run(workspace, words, *lines, programs):
    """Launch until these lines have come, or cannot come. Return what was printed."""
    drives = max(1, sum('I drive' in line for line in lines))
    patience = Patience()

    def is_done(text):
        silent = patience.is_over('drives on' in text, text)
        # Before launch prints what a program says, it has started all of them.
        speaks = re.search(r'^\[\S+-\d+\] ', text, re.MULTILINE)
        all_said = all(line in text for line in lines) or text.count('I drive') >= drives
        return all_said or silent or (speaks and len(started(text)) < programs)

    text = launch(workspace, words, is_done)
    if len(started(text)) >= programs or error_of_launch(text):
        return text
    # If one is missing, what the others had said by then differs from run to run.
    return re.sub(r'(?m)^\[\S+-\d+\] .*', '', text)


def says(text, *lines, hint=None):
    """Return whether a launch has printed the lines, or what it did instead, and its error.

    `hint` takes the place of the hint of the point, if there is no error.
    """
    if all(line in text for line in lines):
        return True
    error = error_of_launch(text)
    parts = [f'started: {", ".join(started(text)) or "nothing"}']
    parts += sorted(set(re.findall(r'\[[\w.]+\]: I drive.*', text)))
    found = '; '.join([*parts, error] if error else parts)
    raise Failed(found, hint='' if error else hint)


def starts(text, *names):
    """Return whether a launch has started these programs, and no other."""
    if started(text) == sorted(names):
        return True
    found = f'started: {", ".join(started(text)) or "nothing"}'
    raise Failed(found, hint='' if error_of_launch(text) else None)


# --- A program that is started again


def guarded(workspace, words, kill=False):
    """Launch a file, perhaps kill its program, and wait until nothing more happens.

    Return the log of the launch, whose lines begin with their times, and what it printed.
    """
    most = 1 if kill else 3
    command = f'source install/setup.bash\nros2 launch {words}'
    with workspace.start(command, 'the launch') as process:
        count, since_s, killed = 0, time.monotonic(), not kill
        while process.running and time.monotonic() - since_s < 12:
            lines = process.lines
            if len(lines) > count:
                count, since_s = len(lines), time.monotonic()
            ids = re.findall(r'started with pid \[(\d+)', '\n'.join(lines))
            if not killed and ids:
                os.kill(int(ids[0]), signal.SIGKILL)
                killed = True
            if len(ids) > most:
                break
            time.sleep(0.05)
        process.interrupt()
    log = workspace.file('log/ros/latest/launch.log')
    text = '\n'.join(process.lines).replace(f'{workspace.path}/', '')
    return (log.read_text() if started(text) else ''), text


def times(log, event):
    """Return the times of the lines of a log that tell of an event."""
    return [float(line.split()[0]) for line in log.splitlines() if event in line]


# --- The camera


def turns(camera, limit_s):
    """Wait until a camera has logged that it turned, and has ended without an error."""

    def has_turned():
        return camera.says('Turned: True')

    wait_until(lambda: has_turned() or not camera.running, limit_s)
    if not camera.running and not has_turned():
        raise ended('beside a robot it ends', camera)
    if not has_turned():
        if camera.lines and 'I wait for' in camera.lines[-1]:
            found = 'the robot is there, and it still waits: has the service another name, or does '
            found += 'nobody spin while it waits for the answer?'
            raise Failed(found, hint='')
        said = ' / '.join(camera.lines[-3:]) or 'nothing'
        found = f'the robot is there, and it does not log "Turned: True". Its last lines: {said}'
        raise Failed(found, hint='rclpy.spin_until_future_complete(self, future, timeout_sec=5.0)')
    if not camera.has_ended(limit_s):
        raise Failed('it has turned the camera, and does not end', hint='')
    if camera.exit_code() != 0:
        raise ended('it ends with an error', camera)
    return True


def gives_up(camera, silent):
    """Wait until a camera has ended, whose robot is asked and never answers."""
    wait_until(lambda: silent.says('asked') or not camera.running, 30)
    if not silent.says('asked'):
        raise ended('it never asks', camera)
    # Five seconds, and what a slow machine needs for the end of a program.
    if not camera.has_ended(15):
        return 'no answer comes, and it waits for ever'
    asked = silent.lines.count('asked')
    if asked != 1:
        return f'it asks {asked} times: {camera.error}'
    if camera.exit_code() != 0:
        return f'no answer comes, and it ends: {camera.error}'
    return camera.says('Turned: False') or 'no answer comes, and it does not log "Turned: False"'


def ended(what, camera):
    """Return that a camera has ended, and why. With an error no other hint is needed."""
    return Failed(f'{what}: {camera.error}', hint='' if first_error(camera.lines) else None)
