"""What the tasks of the lesson "Make a package" are judged by."""

import contextlib
import itertools
import re
import shlex
import signal
import time
from pathlib import Path
from typing import NamedTuple

import psutil
from std_msgs.msg import String

from helpers.checks.bench import Bench
from helpers.checks.builds import builds, setup_fits
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


# Code before a listener: each time.sleep is printed, and the first waits until a file is there.
HELD = """
import pathlib, time
real_sleep = time.sleep

def sleep(seconds):
    print(f'sleeps {seconds:g}', flush=True)
    while not pathlib.Path('.go').exists():
        real_sleep(0.01)

time.sleep = sleep
"""
RAISES = """
import time

def sleep(seconds):
    raise ValueError('a mistake in the callback')

time.sleep = sleep
"""


MORE_THAN_A_SLEEP_S = 0.4  # of its callback, which sleeps for 0.2 s


@tasks.add(own_domain=True)
def a_slow_listener(workspace, file):
    first = ['Hello World: 7', 'Good morning']
    later = [f'Hello World: {number}' for number in range(100, 115)]
    heard = re.compile(r'\[INFO\] \[listener\]: I heard: "(.*)" at ([\d.]+)$')

    @cached
    def run():
        """Send two texts while it sleeps, fifteen while it still does, and press Ctrl+C."""
        workspace.terminal('rm -f .go')
        with listener(workspace, file, HELD) as (bench, program):
            bench.say('topic', String(data=first[0]))
            bench.wait(lambda: program.lines or not program.running, 8)
            bench.say('topic', *(String(data=text) for text in [first[1], *later]), at_once=True)
            workspace.write('.go', '')
            bench.wait(lambda: program.says(later[-1]) or not program.running, 8)
            went_on = program.running
            ended = program.end(limit_s=4)
            return Run(program.lines, went_on, ended)

    def texts():
        return [match for line in run().lines if (match := heard.match(line))]

    def logs():
        if not run().went_on and run().failed:
            raise Failed(error_in(run().lines), hint='')
        found = texts()
        if not found or found[0][1] != first[0] or not re.fullmatch(r'\d+\.\d{4}', found[0][2]):
            said = [line for line in run().lines if not line.startswith('sleeps')]
            shapes = [re.sub(r'\d+\.\d{4}$', 'TIME', line) for line in said[:1]]
            right = f'[INFO] [listener]: I heard: "{first[0]}" at TIME'
            return f'it printed {"".join(shapes) or "nothing"}, not {right}'
        stamp_s = float(found[0][2])
        near = abs(stamp_s - time.monotonic()) < 100
        return near or f'{stamp_s:.0f} is no time of time.monotonic()'

    def sleeps():
        needs(logs, 'it does not log what it hears')
        kinds = ['heard' if heard.match(line) else line for line in run().lines]
        if kinds[:4] == ['heard', 'sleeps 0.2'] * 2:
            return True
        return f'of two callbacks it printed: {", ".join(kinds[:4]) or "nothing"}'

    def keeps_ten():
        needs(logs, 'it does not log what it hears')
        found = [match[1] for match in texts()][1:]
        kept = [text for text in [first[1], *later] if text in found]
        return found == later[-10:] or f'of 16 that came while it slept it heard {len(kept)}'

    def ends():
        if not run().went_on:
            return 'it ends by itself'
        if run().failed:
            return 'at Ctrl+C it ends with a traceback'
        return run().ended or 'at Ctrl+C it does not end'

    def ends_after_a_launch():
        needs(ends)
        with listener(workspace, file) as (bench, program):
            bench.say('topic', String(data=first[0]))
            bench.wait(lambda: program.lines or not program.running, 8)  # then it spins
            # In a callback it would only see the flag, without an error: so let it wait again.
            bench.wait(lambda: not program.running, MORE_THAN_A_SLEEP_S)
            if not program.end(signal.SIGTERM, limit_s=4):
                return 'it does not end when a launch ends it (SIGTERM)'
            if program.failed:
                return f'when a launch ends it (SIGTERM): {program.error}'
        with listener(workspace, file, RAISES) as (bench, program):
            bench.say('topic', String(data=first[0]))
            program.has_ended(8)
            return program.failed or 'an error in its callback is not seen'

    hint = 'get_logger().info(...) with an f-string, and {time.monotonic():.4f}, as in talker.py.'
    end_hint = 'spin is between try: and except (KeyboardInterrupt, ...), as in talker.py.'
    errors = 'except names two errors, as in talker.py, and no other.'
    return [
        ('it logs what it hears, with the time', logs, hint),
        ('it sleeps for 0.2 s after each', sleeps, 'time.sleep(0.2), below the log.'),
        ('its queue has depth 10', keeps_ten, 'The last argument of create_subscription.'),
        ('Ctrl+C ends it', ends, end_hint),
        ('so does a launch, and an error is seen', ends_after_a_launch, errors),
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

    entries = 'Is there a comma behind each entry? Paths begin in the folder of the package.'
    names = (
        "'talker = hello_pkg.talker:main': the executable, the module in its package, the function."
    )
    files = "('share/' + package_name + '/config', ['config/slow.yaml'])"
    given = 'The lines that were there stay.'
    return [
        ('it builds', built, entries),
        ('two executables are installed', installed, names),
        ('they talk', they_talk, names),
        ('the parameters are installed', has_parameters, files),
        ('it says what package.xml says', lambda: setup_fits(workspace, 'src/hello_pkg'), given),
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
import itertools, resource, threading, time
barrier = threading.Barrier({count}, lambda: print('All are here', flush=True))
calls = itertools.count()
real_sleep = time.sleep

def used_s():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime

def sleep(seconds):
    if next(calls) >= {count}:
        return
    if barrier.wait(3) == 0:  # one of them looks how the others wait
        begun_s = used_s()
        for _ in range(100):
            real_sleep(0.01)
            if used_s() > begun_s + 0.3:
                break
        print('They meet', f'{{used_s() - begun_s:.2f}}', flush=True)
    else:
        real_sleep(1.0)

time.sleep = sleep
"""


@tasks.add(own_domain=True)
def callbacks_in_parallel(workspace, file):
    def meet(count):
        """Let each callback wait in its sleep until `count` of them are there."""
        texts = [f'Hello World: {number}' for number in range(count)]
        # A text that comes when no thread is free: only then the default looks for it all the time.
        late = 'All are here', 'Hello again'
        run = run_main(workspace, file, texts, MEET.format(count=count), 'They meet', late)
        if not any(line.startswith('They meet') for line in run.lines):
            if any('BrokenBarrierError' in line for line in run.lines) or not run.lines:
                return f'{count} callbacks did not run at the same time'
            raise Failed(error_in(run.lines), hint='')
        return run

    def together(run):
        return run if isinstance(run, str) else True

    first, last = cached(lambda: meet(2)), cached(lambda: meet(8))

    def two():
        return together(first())

    def eight():
        needs(two, 'not even two')
        return together(last())

    def is_idle():
        """While eight callbacks only wait, the program must not use a core."""
        needs(eight, 'eight callbacks never run at once')
        used = [line for line in last().lines if line.startswith('They meet')]
        idle = float(used[0].split()[-1]) < 0.3
        return idle or 'while all callbacks sleep, it uses a whole core'

    def ends():
        needs(two, 'two callbacks never run at once')
        run = first()
        if run.failed:
            return 'at Ctrl+C it ends with a traceback'
        return run.ended or 'at Ctrl+C it does not end'

    hint = 'ReentrantCallbackGroup() for the subscription, MultiThreadedExecutor(num_threads=8), '
    hint += 'spin.'
    return [
        ('two at a time', two, hint),
        ('eight at a time', eight, hint),
        ('it rests while they sleep', is_idle, 'Keep the line with event_callbacks.'),
        ('Ctrl+C ends it', ends, 'Keep try and except around the spin.'),
    ]


@tasks.add(limit_s=150)
def build_source_run(workspace):
    def callbacks_overlap():
        listening, begun_s = open_terminal(workspace, 'new_listener'), time.monotonic()

        def heard():
            return times_printed(listening, begun_s).sort_values()

        def overlap():
            # One thread starts a callback 0.2 s after the one before, or later.
            return bool(heard().diff().min() < 0.199)

        def is_known():
            # Of a whole talk even one thread hears about twenty numbers; of its end only a few, and
            # these may come apart on a busy machine.
            return overlap() or (40 in heard() and len(heard()) > 10) or not listening.running

        def is_over():
            return time.monotonic() > begun_s + (60 if heard().empty else 110)

        # The terminal builds before it starts the listener, for which the talker waits. If another
        # terminal listens, the talker may say all that it says before: then another one starts.
        while not is_known() and not is_over():
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
    fits, given = lambda: setup_fits(workspace, 'src/forgetful_pkg'), 'Three faults, and no more.'
    return [
        ('it builds', built, 'Which file is there: resource/forgetful_pkg.'),
        ('counter counts messages', counts, module),
        ('it says what package.xml says', fits, given),
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
        --build-type ament_python --license Apache-2.0 --dependencies rclpy std_msgs \\
        --description 'Count messages' --maintainer-name you --maintainer-email you@example.com
        rm -f ../src/forgetful_pkg/package.xml
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


@contextlib.contextmanager
def listener(workspace, file, before=''):
    """Run main() of a file: yield a bench and the program, which has subscribed to the topic.

    Nothing is built. `before` is code that runs before the file. Raises Failed if the program runs
    and does not subscribe.
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

        bench.wait(is_there, 12)
        bench.wait(subscribed_or_ended)
        if program.running and not publisher.get_subscription_count():
            raise Failed('it runs, and does not subscribe to the topic "topic"', hint='')
        yield bench, program


def run_main(workspace, file, texts, before, last, late=None):
    """Run main() of a file, publish texts at once, and press Ctrl+C when `last` was printed.

    `late` is what it prints before one more text is published, and that text.
    """
    with listener(workspace, file, before) as (bench, program):
        bench.say('topic', *(String(data=text) for text in texts), at_once=True)
        if late:
            bench.wait(lambda: program.says(late[0]) or not program.running, 8)
            bench.say('topic', String(data=late[1]), at_once=True)
        bench.wait(lambda: program.says(last) or not program.running, 8)
        went_on = program.running
        ended = program.end(limit_s=4)
        return Run(program.lines, went_on, ended)
