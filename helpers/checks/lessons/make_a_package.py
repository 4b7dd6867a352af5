"""What the tasks of the lesson "Make a package" are judged by."""

import re
import time

import psutil
from std_msgs.msg import String

from helpers.checks.bench import Bench
from helpers.checks.builds import builds
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.programs import line_of, manifest, needed, open_terminal, sourced
from helpers.checks.tasks import Tasks
from helpers.trials import times_printed
from helpers.workspace import error_in, wait_until

tasks = Tasks()
check = tasks.check


@tasks.add
def create_a_package(workspace):
    def has_type():
        kind = manifest(workspace, 'src/hello_pkg').get_build_type()
        return kind == 'ament_python' or f'its type is {kind}'

    def has_license():
        return workspace.file('src/hello_pkg/LICENSE').is_file() or 'it has no file LICENSE'

    license_hint = 'Write two dashes, then the name of what the option sets.'
    return [
        ('the type is ament_python', has_type, 'An option and its value: --build-type ...'),
        ('it has a license', has_license, license_hint),
    ]


@tasks.add
def a_slow_listener(workspace, file):
    texts = ['Hello World: 7', 'Good morning']
    run = cached(lambda: run_main(workspace, file, texts))

    def logs():
        lines, went_on = run()
        if not went_on and any('Traceback' in line for line in lines):
            return error_in(lines)
        shapes = [re.sub(r'\d+\.\d{4}$', 'TIME', line) for line in lines[:2]]
        right = [f'[INFO] [listener]: I heard: "{text}" at TIME' for text in texts]
        return shapes == right or f'it printed: {" / ".join(shapes) or "nothing"}'

    def sleeps():
        lines, _ = run()
        times = [float(at) for at in re.findall(r'at ([\d.]+)$', '\n'.join(lines), re.MULTILINE)]
        if len(times) != 2:
            return f'{len(times)} of its lines end with a time'
        if abs(times[0] - time.monotonic()) > 100:
            return f'{times[0]:.0f} is no time of time.monotonic()'
        apart = times[1] - times[0]
        return 0.199 < apart < 1.5 or f'they are {apart:.2f} s apart'

    def ends():
        lines, went_on = run()
        if not went_on:
            return 'it ends by itself'
        return not any('Traceback' in line for line in lines) or 'it ends with a traceback'

    hint = 'get_logger().info(...) with an f-string, and {time.monotonic():.4f}, as in talker.py.'
    end_hint = 'spin is between try: and except (KeyboardInterrupt, ...), as in talker.py.'
    return [
        ('it logs two messages with their times', logs, hint),
        ('the next callback starts 0.2 s later', sleeps, 'time.sleep(0.2), at the end.'),
        ('Ctrl+C ends it', ends, end_hint),
    ]


@tasks.add
def what_it_needs(workspace):
    def type_is_right():
        kind = manifest(workspace, 'src/hello_pkg').get_build_type()
        return kind == 'ament_python' or f'its type is {kind}'

    def needs_both():
        package = manifest(workspace, 'src/hello_pkg')
        names = sorted(needed(package, 'run'))
        others = sorted((needed(package, 'build') | {*names}) - {'rclpy', 'std_msgs'})
        if others:
            return f'it names {" ".join(others)}, too'
        return names == ['rclpy', 'std_msgs'] or f'it names {" ".join(names) or "nothing"}'

    hint = 'One line <depend>NAME</depend> for each. std_msgs.msg is a part of std_msgs.'
    return [
        ('the build type is ament_python', type_is_right, '<export>, <build_type>, close both.'),
        ('to run it, both packages are needed, and no other', needs_both, hint),
    ]


@tasks.add(limit_s=90)
def what_is_installed(workspace):
    built = cached(lambda: builds(workspace, 'hello_pkg'))

    def executables():
        if built() is not True:
            return 'it is not built'
        names = sourced(workspace, 'ros2 pkg executables hello_pkg').splitlines()
        right = ['hello_pkg listener', 'hello_pkg talker']
        return names == right or f'it has {", ".join(names) or "none"}'

    installed = cached(executables)

    def they_talk():
        if installed() is not True:
            return 'they are not installed'
        run = 'source install/setup.bash\nros2 run hello_pkg'
        with (
            workspace.start(f'{run} listener', 'the listener') as listening,
            workspace.start(f'{run} talker', 'the talker') as talking,
        ):
            line_of(talking, 'Hello World: 2"')
            # The listener can lose the first ones: the talker finds it before it finds the talker.
            return bool(line_of(listening, 'I heard: "Hello World'))

    def has_parameters():
        if built() is not True:
            return 'it is not built'
        file = workspace.file('install/hello_pkg/share/hello_pkg/config/slow.yaml')
        return file.is_file() or 'share/hello_pkg/config has no slow.yaml'

    names = (
        "'talker = hello_pkg.talker:main': the executable, the module in its package, the function."
    )
    files = "('share/' + package_name + '/config', ['config/slow.yaml'])"
    return [
        ('it builds', built, 'Which line of setup.py does the message name?'),
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
            return 'the talker does not run'
        # No later message can push the last one out of the queue, so it always arrives.
        listening = open_terminal(workspace, 'listener')
        return bool(line_of(listening, 'I heard: "Hello World: 40"'))

    hint = 'Package not found: not sourced. No executable found: what is its name in setup.py?'
    return [
        ('the talker has published all', talker_has_published, hint),
        ('the listener has heard the last one', listener_has_heard, 'Is its terminal open?'),
    ]


@tasks.add
def callbacks_in_parallel(workspace, file):
    def meet(count):
        """Let each callback wait in its sleep until `count` of them are there."""
        texts = [f'Hello World: {number}' for number in range(count)]
        lines, _ = run_main(workspace, file, texts, MEET.format(count=count), last='They meet')
        if 'They meet' in lines:
            return True
        if any('BrokenBarrierError' in line for line in lines) or not lines:
            return f'{count} callbacks did not run at the same time'
        return error_in(lines)

    two = cached(lambda: meet(2))

    def eight():
        return meet(8) if two() is True else 'not even two'

    hint = 'ReentrantCallbackGroup() for the subscription, MultiThreadedExecutor(num_threads=8), '
    hint += 'spin.'
    return [('two at a time', two, hint), ('eight at a time', eight, hint)]


@tasks.add(limit_s=90)
def build_source_run(workspace):
    def callbacks_overlap():
        listening = open_terminal(workspace, 'new_listener')
        run = 'source install/setup.bash\nros2 run hello_pkg talker'
        with workspace.start(run, 'the talker') as talking:

            def all_published():
                return any('World: 40' in line for line in talking.lines)

            # The terminal builds before it starts the listener, for which the talker waits.
            wait_until(lambda: all_published() or not listening.running, 60)
            if not listening.running:
                return f'new_listener has ended: {error_in(listening.lines)}'
            first_s = times_printed(talking).min()
            if not wait_until(lambda: 40 in times_printed(listening, first_s), 8):
                return 'the listener does not hear the new talker'
            heard = times_printed(listening, first_s)
        # One thread starts a callback 0.2 s after the one before, or later.
        old = 'the listener that runs is the old one, with one thread'
        return bool(heard.diff().min() < 0.199) or old

    hint = 'Which command copies the changed file from src to install?'
    return [('the new listener runs: its callbacks overlap', callbacks_overlap, hint)]


@tasks.add
def other_arguments(workspace):
    def hears():
        open_terminal(workspace, 'other_talker')
        run = 'source install/setup.bash\nros2 run hello_pkg listener --ros-args -r topic:=other'
        with Bench() as bench, workspace.start(run, 'the listener') as listening:

            def has_heard():
                return any('Hello World' in line for line in listening.lines)

            bench.wait(lambda: bench.tester.count_subscribers('/other'), 8)
            if bench.wait(has_heard, 3):
                return True
            on_other = bench.tester.count_publishers('/other')
        if not on_other:
            return 'nobody publishes on other'
        return 'the talker has said all that it says: run the cell of the task again'

    def has_the_file():
        value = sourced(workspace, 'ros2 param get /talker period_s')
        if value != 'Double value is: 0.25':
            return value or 'ros2 param get prints nothing'
        words = words_of(open_terminal(workspace, 'other_talker'))
        installed = workspace.file('install/hello_pkg/share/hello_pkg/config/slow.yaml')
        for option, file in zip(words, words[1:], strict=False):
            if option == '--params-file' and (workspace.path / file).resolve().samefile(installed):
                return True
        given = ' '.join(words[words.index('--ros-args') :])
        return f'the talker has no --params-file with the installed slow.yaml: {given}'

    def is_not_deprecated():
        lines = open_terminal(workspace, 'other_talker').lines
        warnings = [line for line in lines if 'deprecated' in line]
        if warnings:
            return warnings[0]
        if open_terminal(workspace, 'other_talker').running:
            return True
        return f'the talker has ended: {error_in(lines)}'

    file_hint = '--params-file $(ros2 pkg prefix --share ...)/config/slow.yaml'
    return [
        ('the listener hears the talker on "other"', hears, '--ros-args -r old:=new'),
        ('period_s is 0.25, from the file', has_the_file, file_hint),
        ('no argument is deprecated', is_not_deprecated, 'What begins the ROS arguments?'),
    ]


@tasks.add(limit_s=90)
def fix_a_package(workspace):
    def build():
        write_forgetful(workspace)
        return builds(workspace, 'forgetful_pkg')

    built = cached(build)

    def counts():
        if built() is not True:
            return 'it is not built'
        run = 'source install/setup.bash\nros2 run'
        with (
            workspace.start(f'{run} forgetful_pkg counter', 'counter') as counter,
            workspace.start(f'{run} hello_pkg talker', 'the talker'),
        ):
            return bool(line_of(counter, 'Counted: 5'))

    module = 'No module named: which file is in the folder, and which names are in setup.py?'
    return [
        ('it builds', built, 'Which file is there: resource/forgetful_pkg.'),
        ('counter counts messages', counts, module),
    ]


# --- The listener, without a build

MEET = """
import threading, time
barrier = threading.Barrier({count})
def sleep(seconds):
    barrier.wait(3)
    print('They meet\\n', end='', flush=True)  # in one piece
time.sleep = sleep
"""


def run_main(workspace, file, texts, before='', last=None):
    """Run main() of a file, publish texts at once, and press Ctrl+C when `last` was printed.

    Return the lines of the program, and whether it ran until then. `before` is code that runs
    before the file. Raises Failed if nobody subscribes to the topic.
    """
    start = f'{before}\nimport runpy\nrunpy.run_path({file!r})["main"]()\n'
    workspace.write('.start.py', start)
    command = 'PYTHONPATH=src/hello_pkg exec python -B .start.py'
    with Bench() as bench:
        publisher = bench.publisher('topic', String)
        with workspace.start(command, 'the listener') as process:

            def subscribed_or_ended():
                return publisher.get_subscription_count() or not process.running

            def is_there():
                return subscribed_or_ended() or 'listener' in bench.tester.get_node_names()

            bench.wait(is_there, 8)
            bench.wait(subscribed_or_ended)
            if process.running and not publisher.get_subscription_count():
                raise Failed('it runs, and does not subscribe to the topic "topic"')
            bench.say('topic', *(String(data=text) for text in texts), at_once=True)

            def has_ended_or_said():
                return not process.running or any(
                    (last or texts[-1]) in line for line in process.lines
                )

            bench.wait(has_ended_or_said, 8)
            went_on = process.running
    return process.lines, went_on


def words_of(terminal):
    """Return the words of the command that runs in a terminal, the innermost one."""
    programs = psutil.Process(terminal.pid).children(recursive=True)
    return next((words for p in reversed(programs) if '--ros-args' in (words := p.cmdline())), [])


# --- Somebody else's package

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
