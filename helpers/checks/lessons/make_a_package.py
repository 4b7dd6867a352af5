"""What the tasks of the lesson "Make a package" are judged by."""

import contextlib
import itertools
import re
import shlex
import time
from pathlib import Path
from typing import NamedTuple

import psutil
from std_msgs.msg import String

from helpers.checks.bench import Bench
from helpers.checks.builds import builds
from helpers.checks.errors import Failed
from helpers.checks.points import cached, needs
from helpers.checks.programs import Program, line_of, manifest, needed, open_terminal, sourced
from helpers.checks.tasks import Tasks
from helpers.trials import times_printed
from helpers.workspace import TRACEBACK, error_in, wait_until

tasks = Tasks()
check = tasks.check

NOT_BUILT = 'it is not built'


@tasks.add
def create_a_package(workspace):
    def has_license():
        manifest(workspace, 'src/hello_pkg')
        return workspace.file('src/hello_pkg/LICENSE').is_file() or 'it has no file LICENSE'

    build_type = 'An option and its value: --build-type ...'
    license_hint = 'Write two dashes, then the name of what the option sets.'
    return [
        ('the type is ament_python', lambda: is_of_python(workspace), build_type),
        ('it has a license', has_license, license_hint),
    ]


def is_of_python(workspace):
    kind = manifest(workspace, 'src/hello_pkg').get_build_type()
    return kind == 'ament_python' or f'its type is {kind}'


@tasks.add(own_domain=True)
def a_slow_listener(workspace, file):
    texts = ['Hello World: 7', 'Good morning']
    run = cached(lambda: run_main(workspace, file, texts))

    def logs():
        if not run().went_on and run().failed:
            raise Failed(error_in(run().lines), hint='')
        shapes = [re.sub(r'\d+\.\d{4}$', 'TIME', line) for line in run().lines[:2]]
        right = [f'[INFO] [listener]: I heard: "{text}" at TIME' for text in texts]
        return shapes == right or f'it printed: {" / ".join(shapes) or "nothing"}'

    def sleeps():
        printed = re.findall(r'at ([\d.]+)$', '\n'.join(run().lines), re.MULTILINE)
        if len(printed) != 2:
            return f'{len(printed)} of its lines end with a time'
        first_s, second_s = map(float, printed)
        if abs(first_s - time.monotonic()) > 100:
            return f'{first_s:.0f} is no time of time.monotonic()'
        apart_s = second_s - first_s
        return 0.199 < apart_s < 1.5 or f'they are {apart_s:.2f} s apart'

    def ends():
        if not run().went_on:
            return 'it ends by itself'
        if run().failed:
            return 'it ends with a traceback'
        return run().ended or 'it does not end'

    hint = 'get_logger().info(...) with an f-string, and {time.monotonic():.4f}, as in talker.py.'
    end_hint = 'spin is between try: and except (KeyboardInterrupt, ...), as in talker.py.'
    return [
        ('it logs two messages with their times', logs, hint),
        ('the next callback starts 0.2 s later', sleeps, 'time.sleep(0.2), at the end.'),
        ('Ctrl+C ends it', ends, end_hint),
    ]


@tasks.add
def what_it_needs(workspace):
    def needs_both():
        package = manifest(workspace, 'src/hello_pkg')
        names = sorted(needed(package, 'run'))
        others = sorted((needed(package, 'build') | {*names}) - {'rclpy', 'std_msgs'})
        if others:
            return f'it names {" ".join(others)}, too'
        return names == ['rclpy', 'std_msgs'] or f'it names {" ".join(names) or "nothing"}'

    build_type = '<export>, <build_type>, close both.'
    hint = 'One line <depend>NAME</depend> for each. std_msgs.msg is a part of std_msgs.'
    return [
        ('the build type is ament_python', lambda: is_of_python(workspace), build_type),
        ('to run it, both packages are needed, and no other', needs_both, hint),
    ]


@tasks.add(limit_s=90, own_domain=True)
def what_is_installed(workspace):
    built = cached(lambda: builds(workspace, 'hello_pkg'))

    @cached
    def installed():
        needs(built, NOT_BUILT)
        names = sourced(workspace, 'ros2 pkg executables hello_pkg').splitlines()
        right = ['hello_pkg listener', 'hello_pkg talker']
        return names == right or f'it has {", ".join(names) or "none"}'

    def they_talk():
        needs(installed, 'they are not installed')
        with (
            ros2_run(workspace, 'hello_pkg listener', 'the listener') as listening,
            ros2_run(workspace, 'hello_pkg talker', 'the talker') as talking,
        ):
            line_of(talking, 'Hello World: 2"')
            # The listener can lose the first ones: the talker finds it before it finds the talker.
            return bool(line_of(listening, 'I heard: "Hello World'))

    def has_parameters():
        needs(built, NOT_BUILT)
        file = workspace.file('install/hello_pkg/share/hello_pkg/config/slow.yaml')
        return file.is_file() or 'share/hello_pkg/config has no slow.yaml'

    entries = 'Is there a comma after each entry? Paths begin in the folder of the package.'
    names = (
        "'talker = hello_pkg.talker:main': the executable, the module in its package, the function."
    )
    files = "('share/' + package_name + '/config', ['config/slow.yaml'])"
    return [
        ('it builds', built, entries),
        ('two executables are installed', installed, names),
        ('they talk', they_talk, names),
        ('the parameters are installed', has_parameters, files),
    ]


@tasks.add
def a_second_terminal(workspace):
    def talker_has_published():
        talking = open_terminal(workspace, 'talker')
        return bool(line_of(talking, 'Publishing: "Hello World: 40"'))

    def listener_has_heard():
        if not open_terminal(workspace, 'talker').running:
            raise Failed('the talker does not run', hint='')
        # No later message can push the last one out of the queue, so it always arrives.
        listening = open_terminal(workspace, 'listener')
        return bool(line_of(listening, 'I heard: "Hello World: 40"'))

    hint = 'Package not found: not sourced. No executable found: what is its name in setup.py?'
    return [
        ('the talker has published all', talker_has_published, hint),
        ('the listener has heard the last one', listener_has_heard, 'Is its terminal open?'),
    ]


MEET = """
import threading, time
barrier = threading.Barrier({count})
def sleep(seconds):
    barrier.wait(3)
    print('They meet\\n', end='', flush=True)  # in one piece
time.sleep = sleep
"""


@tasks.add(own_domain=True)
def callbacks_in_parallel(workspace, file):
    def meet(count):
        """Let each callback wait in its sleep until `count` of them are there."""
        texts = [f'Hello World: {number}' for number in range(count)]
        lines = run_main(workspace, file, texts, MEET.format(count=count), 'They meet').lines
        if 'They meet' in lines:
            return True
        if any('BrokenBarrierError' in line for line in lines) or not lines:
            return f'{count} callbacks did not run at the same time'
        raise Failed(error_in(lines), hint='')

    two = cached(lambda: meet(2))

    def eight():
        needs(two, 'not even two')
        return meet(8)

    hint = 'ReentrantCallbackGroup() for the subscription, MultiThreadedExecutor(num_threads=8), '
    hint += 'spin.'
    return [('two at a time', two, hint), ('eight at a time', eight, hint)]


@tasks.add(limit_s=90)
def build_source_run(workspace):
    def callbacks_overlap():
        listening, begun_s = open_terminal(workspace, 'new_listener'), time.monotonic()

        def heard():
            return times_printed(listening, begun_s).sort_values()

        def overlap():
            # One thread starts a callback 0.2 s after the one before, or later.
            return bool(heard().diff().min() < 0.199)

        def is_known():
            return overlap() or (40 in heard() and len(heard()) > 3) or not listening.running

        # The terminal builds before it starts the listener, for which the talker waits. If another
        # terminal listens, the talker may say all that it says before: then another one starts.
        while not is_known() and time.monotonic() < begun_s + 60:
            with ros2_run(workspace, 'hello_pkg talker', 'the talker') as talking:
                wait_until(lambda: 40 in times_printed(talking) or is_known(), 60)
                wait_until(is_known, 5)
        if not listening.running:
            return f'new_listener has ended: {error_in(listening.lines)}'
        if heard().empty:
            return 'the listener does not hear the new talker'
        if not overlap():
            return 'the listener that runs is the old one, with one thread'
        if program_in(workspace, listening, limit_s=2):
            return True
        found = 'the listener is new, but not that in the folder install of the workspace'
        raise Failed(found, hint='colcon builds in the folder in which it is started.')

    hint = 'Which command copies the changed file from src to install?'
    return [('the new listener runs: its callbacks overlap', callbacks_overlap, hint)]


@tasks.add(own_domain=True)
def other_arguments(workspace):
    @cached
    def the_talker():
        """Return the process of the talker in its terminal."""
        terminal = open_terminal(workspace, 'other_talker')
        if talker := program_in(workspace, terminal, limit_s=20):
            return talker
        ended = '' if terminal.running else f': {error_in(terminal.lines)}'
        raise Failed(f'the terminal runs no talker of hello_pkg{ended}', hint='')

    @cached
    def tried():
        """Start the same talker beside a listener, where no other node is.

        Return what the listener and the talker show: is it heard, and what is period_s?
        """
        talker = the_talker()
        again = f'cd {shlex.quote(talker.cwd())}\nexec {shlex.join(talker.cmdline())}'
        with (
            Bench() as bench,
            ros2_run(workspace, 'hello_pkg listener --ros-args -r topic:=other', 'it') as listener,
            workspace.start(f'source install/setup.bash\n{again}', 'the same talker') as talking,
        ):

            def is_heard():
                return any('Hello World' in line for line in listener.lines)

            def both_are_there():
                return {'talker', 'listener'} <= {*bench.tester.get_node_names()}

            bench.wait(lambda: both_are_there() or not talking.running, 8)
            if not talking.running:
                raise Failed(f'the talker has ended: {error_in(talking.lines)}', hint='')
            heard = bench.wait(is_heard, 3) or (
                'a talker publishes on other, and the listener does not hear it'
                if bench.tester.count_publishers('/other')
                else 'nobody publishes on other'
            )
            return heard, sourced(workspace, 'ros2 param get /talker period_s')

    def has_the_file():
        value, talker = tried()[1], the_talker()
        if value != 'Double value is: 0.25':
            return value or 'ros2 param get prints nothing'
        words = talker.cmdline()
        installed = workspace.file('install/hello_pkg/share/hello_pkg/config/slow.yaml')
        for option, file in itertools.pairwise(words):
            if option == '--params-file' and Path(talker.cwd(), file).samefile(installed):
                return True
        given = ' '.join(words[2:])  # behind Python and the file
        return f'the talker has no --params-file with the installed slow.yaml: {given}'

    def is_not_deprecated():
        lines = open_terminal(workspace, 'other_talker').lines
        if warnings := [line for line in lines if 'deprecated' in line]:
            return warnings[0]
        return bool(the_talker().pid)

    file_hint = '--params-file $(ros2 pkg prefix --share ...)/config/slow.yaml'
    return [
        ('the listener hears the talker on "other"', lambda: tried()[0], '--ros-args -r old:=new'),
        ('period_s is 0.25, from the file', has_the_file, file_hint),
        ('no argument is deprecated', is_not_deprecated, 'What begins the ROS arguments?'),
    ]


@tasks.add(limit_s=90, own_domain=True)
def fix_a_package(workspace):
    @cached
    def built():
        write_forgetful(workspace)
        return builds(workspace, 'forgetful_pkg')

    def counts():
        needs(built, NOT_BUILT)
        with (
            ros2_run(workspace, 'forgetful_pkg counter', 'counter') as counter,
            ros2_run(workspace, 'hello_pkg talker', 'the talker'),
        ):
            return bool(line_of(counter, 'Counted: 5'))

    module = 'No module named: which file is in the folder, and which names are in setup.py?'
    return [
        ('it builds', built, 'Which file is there: resource/forgetful_pkg.'),
        ('counter counts messages', counts, module),
    ]


COUNTER = """import rclpy
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import String

def main():
    rclpy.init()
    node, heard = rclpy.create_node('counter'), []

    def callback(message):
        heard.append(message)
        node.get_logger().info(f'Counted: {len(heard)}')

    node.create_subscription(String, 'topic', callback, 10)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
"""


def write_forgetful(workspace):
    """Write all files of forgetful_pkg but its setup.py, which is the learner's."""
    workspace.terminal("""rm -rf .made; mkdir .made; cd .made; ros2 pkg create forgetful_pkg \\
        --build-type ament_python --license Apache-2.0 --dependencies rclpy std_msgs
        cp --recursive --no-clobber forgetful_pkg ../src""")
    workspace.write('src/forgetful_pkg/forgetful_pkg/counter.py', COUNTER)


# --- Programs of the package


def ros2_run(workspace, words, name):
    """Run an installed program in a terminal: `ros2_run(workspace, 'hello_pkg talker', 'it')`."""
    return workspace.start(f'source install/setup.bash\nros2 run {words}', name)


def program_in(workspace, terminal, limit_s):
    """Wait until a terminal runs an installed program. Return its process, or None."""
    install = workspace.file('install').resolve()

    def is_installed(process):
        with contextlib.suppress(psutil.Error):  # it has just ended
            files = [Path(process.cwd(), word).resolve() for word in process.cmdline()]
            return any(file.match(f'{install}/*/lib/*/*') for file in files)
        return False

    def programs():
        with contextlib.suppress(psutil.Error):
            bash = psutil.Process(terminal.pid)
            return [*filter(is_installed, [bash, *bash.children(recursive=True)])]
        return []

    wait_until(lambda: programs() or not terminal.running, limit_s)
    return next(iter(programs()), None)


class Run(NamedTuple):
    """What the main() of a listener did."""

    lines: list[str]
    went_on: bool  # until Ctrl+C was pressed
    ended: bool  # then

    @property
    def failed(self):
        return any(TRACEBACK in line for line in self.lines)


def run_main(workspace, file, texts, before='', last=''):
    """Run main() of a file, publish texts at once, and press Ctrl+C when `last` was printed.

    Nothing is built. `before` is code that runs before the file; `last` is the last text, if
    nothing else is given. Raises Failed if nobody subscribes to the topic.
    """
    start = f'{before}\nimport runpy\nrunpy.run_path({file!r})["main"]()\n'
    workspace.write('.start.py', start)
    command = 'PYTHONPATH=src/hello_pkg exec python -B .start.py'
    with Bench() as bench, Program(workspace.start(command, 'the program')) as program:
        publisher = bench.publisher('topic', String)

        def subscribed_or_ended():
            return publisher.get_subscription_count() or not program.running

        def is_there():
            return subscribed_or_ended() or 'listener' in bench.tester.get_node_names()

        bench.wait(is_there, 8)
        bench.wait(subscribed_or_ended)
        if program.running and not publisher.get_subscription_count():
            raise Failed('it runs, and does not subscribe to the topic "topic"', hint='')
        bench.say('topic', *(String(data=text) for text in texts), at_once=True)
        bench.wait(lambda: program.says(last or texts[-1]) or not program.running, 8)
        went_on = program.running
        ended = program.end(limit_s=4)
        return Run(program.lines, went_on, ended)
