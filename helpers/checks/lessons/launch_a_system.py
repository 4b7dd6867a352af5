"""What the tasks of the lesson "Launch a system" are judged by."""

import itertools
import os
import re
import signal
import time

from helpers.checks.builds import builds, setup_is_whole
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, needs
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
        if len(starts_s) != 3:
            return f'with speed:=fast it is started {often}'
        # A busy machine makes a pause longer, never shorter.
        pauses_s = [
            start - end for end, start in zip(times(log, 'has died'), starts_s[1:], strict=False)
        ]
        return min(pauses_s) < 0.95 or f'it is started again after {min(pauses_s):.1f} s'

    hint = 'respawn_max_retries counts the starts after the first one.'
    return [
        ('a driver that is killed comes back after 0.5 s', comes_back, 'respawn and respawn_delay'),
        ('launch gives up after two more tries', gives_up, hint),
    ]


# Two robots without a body: one never answers, the other one says that it cannot turn.
SERVERS = """import time

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import Trigger


async def never(request, response):
    print('asked', time.time(), flush=True)
    await Future()


def refuse(request, response):
    response.success, response.message = False, 'it is stuck'
    return response


rclpy.init()
node = rclpy.create_node('servers')
group = ReentrantCallbackGroup()  # a second request is counted, too
node.create_service(Trigger, '/silent/camera/turn_left', never, callback_group=group)
node.create_service(Trigger, '/stuck/camera/turn_left', refuse)
print('ready', flush=True)
rclpy.spin(node)
"""


WITH_TIMES = 'export RCUTILS_CONSOLE_OUTPUT_FORMAT="[{severity}] [{time}] [{name}]: {message}"'


@tasks.add(limit_s=120, own_domain=True)
def a_camera_that_waits(workspace):
    def start(words, name):
        run = f'source install/setup.bash\n{WITH_TIMES}\n{words} --ros-args -r __ns:=/{name}'
        return Camera(workspace.start(run, f'{words} in {name}'), name)

    def start_camera(name):
        return start('ros2 run fleet_pkg camera', name)

    @cached
    def tried():
        """Start a camera before its robot, one whose robot is stuck, and one that is not answered.

        All run at once, because each waits for some seconds. Return the three results.
        """
        workspace.write('.tried/servers.py', SERVERS)
        begun_s = time.monotonic()
        with start('exec python3 .tried/servers.py', 'servers') as servers:
            wait_until(lambda: servers.says('ready'), 30)
            now_s = time.monotonic()
            slow = max(1.0, now_s - begun_s)  # a slow machine gets more time
            with (
                start_camera('tried') as camera,
                start_camera('stuck') as stuck,
                start_camera('silent') as silent,
            ):
                first = result_of(lambda: waits(camera, 6 * slow))
                if first is True:
                    with start('ros2 run simulated_robot robot', 'tried'):
                        first = result_of(lambda: turns(camera, 5 * slow))
                second = result_of(lambda: cannot_turn(stuck, now_s + 7 * slow))
                third = result_of(lambda: gives_up(silent, servers, now_s + 11 * slow))
        return first, second, third

    hint = 'while not self.client.wait_for_service(timeout_sec=1.0): log. Only then call_async.'
    success = 'What has come is future.result(), and says in its success whether it has turned.'
    late = 'After timeout_sec=5.0, future.done() says whether the answer has come.'
    return [
        ('it waits for the robot, then turns the camera', lambda: said(tried()[0]), hint),
        ('it says False if the robot cannot turn it', lambda: said(tried()[1]), success),
        ('it asks once, and gives up after 5 s', lambda: said(tried()[2]), late),
    ]


@tasks.add(limit_s=90, own_domain=True)
def install_the_files(workspace):
    @cached
    def built():
        workspace.terminal('rm -rf build install')
        compiled = 'src/fleet_pkg/launch/__pycache__/robot.launch.pyc'
        with workspace.replaced({compiled: ''}):  # as a launch file in Python leaves it
            return builds(workspace, 'fleet_pkg')

    def is_installed():
        needs(built, 'it is not built')
        share = workspace.file('install/fleet_pkg/share/fleet_pkg')
        source = workspace.file('src/fleet_pkg')
        files = [*source.glob('launch/*.launch.*'), *source.glob('config/*.yaml')]
        wanted = sorted(file.relative_to(source).as_posix() for file in files)
        absent = [file for file in wanted if not (share / file).is_file()]
        if absent:
            return f'share/fleet_pkg has no {", no ".join(absent)}'
        return setup_is_whole(workspace, 'src/fleet_pkg')

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


class Camera(Program):
    """The program of a camera in its namespace, which logs with times."""

    TIME = re.compile(r'(?<=\] )\[(\d+\.\d+)\] ')

    def __init__(self, process, name):
        super().__init__(process)
        self._logger = f'[{name}.camera]: '

    @property
    def lines(self):
        """What it has printed so far, without the times."""
        return [self.TIME.sub('', line) for line in super().lines]

    def logged(self, text):
        """Return what its node has logged that begins like this."""
        return [said for said, _ in self._logged(text)]

    def times(self, text):
        """Return when it did so, in seconds."""
        return [time_s for _, time_s in self._logged(text)]

    def _logged(self, text):
        parts = (line.partition(self._logger) for line in super().lines)
        return [
            (said, float(self.TIME.search(before)[1]))
            for before, logger, said in parts
            if logger and said.startswith(text)
        ]


def result_of(test):
    """Return what a test returns, or the Failed that it raises."""
    try:
        return test()
    except Failed as failed:
        return failed


def said(result):
    """Raise it if it is a Failed, else return it."""
    if isinstance(result, Failed):
        raise result
    return result


def waits(camera, limit_s):
    """Return whether a camera without a robot says about once a second that it waits."""

    def times_s():
        return camera.times('I wait for the robot')

    wait_until(lambda: len(times_s()) >= 3 or not camera.running, limit_s)
    if not camera.running:
        raise ended('before there is a robot it ends', camera)
    if len(times_s()) < 2:
        last = ' / '.join(camera.lines[-2:]) or 'nothing'
        return f'before there is a robot it does not log again and again that it waits, but {last}'
    # A busy machine makes a pause longer, never shorter.
    pause_s = min(later - before for before, later in itertools.pairwise(times_s()))
    return pause_s < 1.8 or f'it says only every {pause_s:.1f} s that it waits'


def turns(camera, limit_s):
    """Wait until a camera has logged that it turned, and has ended without an error."""

    def has_said():
        return camera.logged('Turned: ')

    wait_until(lambda: has_said() or not camera.running, limit_s)
    if not camera.running and not has_said():
        raise ended('beside a robot it ends', camera)
    if not has_said():
        if camera.lines and 'I wait for' in camera.lines[-1]:
            found = 'the robot is there, and it still waits: has the service another name, or does '
            found += 'nobody spin while it waits for the answer?'
            raise Failed(found, hint='')
        last = ' / '.join(camera.lines[-3:]) or 'nothing'
        found = f'the robot is there, and it does not log "Turned: True". Its last lines: {last}'
        raise Failed(found, hint='rclpy.spin_until_future_complete(self, future, timeout_sec=5.0)')
    if not camera.has_ended(limit_s):
        raise Failed('it has turned the camera, and does not end', hint='')
    if camera.exit_code() != 0:
        raise ended('it ends with an error', camera)
    return expect(camera.logged('Turned: '), ['Turned: True'], 'beside a robot it logs')


def cannot_turn(camera, until_s):
    """Return whether a camera says False that got an answer without success."""
    if not has_ended_by(camera, until_s):
        return 'the robot answers with success False, and it does not end'
    if camera.exit_code() != 0:
        raise ended('the robot answers with success False, and it ends', camera)
    answer = 'the robot answers with success False, and it logs'
    return expect(camera.logged('Turned: '), ['Turned: False'], answer)


def gives_up(camera, servers, until_s):
    """Return whether a camera asks once, and says after 5 s that no answer came."""
    has_ended = has_ended_by(camera, until_s)
    asked_s = [float(line.split()[1]) for line in servers.lines if line.startswith('asked')]
    if not asked_s:
        raise ended('it never asks', camera)
    if not has_ended:
        return 'no answer comes, and it goes on waiting'
    if len(asked_s) != 1:
        return f'it asks {len(asked_s)} times: {camera.error}'
    if camera.exit_code() != 0:
        return f'no answer comes, and it ends: {camera.error}'
    if camera.logged('Turned: ') != ['Turned: False']:
        return expect(camera.logged('Turned: '), ['Turned: False'], 'no answer comes, and it logs')
    waited_s = camera.times('Turned: ')[0] - asked_s[0]
    return 4.5 < waited_s < 8.0 or f'it waits {waited_s:.1f} s for the answer, not 5 s'


def has_ended_by(camera, until_s):
    """Return whether a camera ends by a time of time.monotonic()."""
    return camera.has_ended(max(0.0, until_s - time.monotonic()))


def ended(what, camera):
    """Return that a camera has ended, and why. With an error no other hint is needed."""
    return Failed(f'{what}: {camera.error}', hint='' if first_error(camera.lines) else None)
