"""Workspaces, with real builds and real processes. Most tests look at the packages of one build."""

import ctypes
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest
from ament_index_python import get_package_share_directory
from support.nodes import Listener, spin
from support.packages import (
    HOSTILE,
    SETUP_PY,
    TALKER,
    package_xml,
    processes_of,
    write_library,
    write_talker,
)
from support.processes import running
from support.waits import wait_for

from helpers.machine import folders
from helpers.ros import ros_session
from helpers.ros.domain import reserve_domain_id
from helpers.workspace import (
    Workspace,
    begin_tf2_msgs,
    given,
    processes,
    provide_tf2_msgs,
    tf2_msgs,
)
from helpers.workspace.build_output import _packages, lines_that_matter
from helpers.workspace.processes import Process
from helpers.workspace.wheels import fix_wheels

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope='module')
def built():
    """Return a workspace in which packages with libraries and with a node have been built."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in HOSTILE.items() | {('HOME', '/proc')}:  # a folder that cannot be written
            patch.setenv(name, value)
        workspace = Workspace('test_workspace')
        write_library(workspace)
        write_talker(workspace)
        cmake = 'cmake_minimum_required(VERSION 3.8)\nproject(user_pkg LANGUAGES NONE)\n'
        workspace.write('src/user_pkg/CMakeLists.txt', f'{cmake}install(CODE "")\n')
        depends = '<exec_depend>talker_pkg</exec_depend>'
        workspace.write('src/user_pkg/package.xml', package_xml('user_pkg', 'cmake', depends))
        workspace.write('copy.py', 'raise RuntimeError')  # as a module of Python is called
        workspace.result = workspace.build()
        workspace.environment()  # sourced in the hostile environment, and kept
    yield workspace
    workspace.close()


@pytest.fixture
def other(built):
    """Return a workspace for what would disturb that of `built`."""
    workspace = Workspace('test_workspace_other')
    yield workspace
    workspace.close()


@pytest.fixture
def shell():
    from IPython.core.interactiveshell import InteractiveShell

    yield InteractiveShell.instance()
    InteractiveShell.clear_instance()


# --- Build ---------------------------------------------------------------------------------------


def test_hostile_variables_reach_no_build(built):
    assert built.result.ok, built.result
    assert built.result.failed is None
    assert str(built.result).endswith('\n\nSummary: 3 packages finished')
    assert (built.path / built.result.log).is_file()


def test_a_failed_build_shows_its_error(other):
    cmake = 'cmake_minimum_required(VERSION 3.8)\nproject(before LANGUAGES NONE)\n'
    other.write('src/before/package.xml', package_xml('before', 'ament_cmake'))
    other.write(
        'src/before/CMakeLists.txt', f'{cmake}message(STATUS one)\nmessage(FATAL_ERROR two)'
    )
    depends = '<depend>before</depend>'
    other.write('src/after/package.xml', package_xml('after', 'ament_cmake', depends))
    result = other.build('before', 'after')
    assert not result.ok
    assert result.failed == 'before'
    assert result.packages == {'before': 'failed', 'after': 'aborted'}
    assert (
        str(result)
        == """\
colcon build --packages-select before after
--- stderr: before
CMake Error at CMakeLists.txt:4 (message):
  two
---
Failed   <<< before
Aborted  <<< after

Summary: 0 packages finished
  1 package failed: before
  1 package aborted: after
Every line: log/latest_build/before/stdout_stderr.log"""
    )
    assert '-- one' in (other.path / result.log).read_text()


def test_mistakes_of_a_python_package(other):
    assert other.build().errors == ['Nothing was built: src/ has no package.']
    write_talker(other, setup=SETUP_PY.replace('setup(\n', 'setup((\n'))
    errors = other.build().errors
    assert errors[0] == 'Traceback (most recent call last):'
    assert errors[-1].startswith('SyntaxError: ')
    result = other.build('talker')
    assert not result.ok
    assert "ignoring unknown package 'talker'" in ' '.join(result.errors)
    assert str(result).endswith('\n\nSummary: 0 packages finished')


def test_a_missing_compiler_gets_one_sentence(other, monkeypatch, tmp_path):
    write_library(other)
    monkeypatch.setenv('PATH', str(tmp_path))  # only what belongs to this Python is left
    said = (
        r'^Missing for this build: C\+\+ compiler. Run `sudo apt install g\+\+`, then run this cell'
    )
    with pytest.raises(RuntimeError, match=said):
        other.build()


def slow_package(workspace: Workspace, seconds: int) -> None:
    workspace.write('src/slow/package.xml', package_xml('slow', 'cmake'))
    workspace.write(
        'src/slow/CMakeLists.txt',
        'cmake_minimum_required(VERSION 3.8)\nproject(slow LANGUAGES NONE)\n'
        f'add_custom_target(slow ALL COMMAND touch started COMMAND sleep {seconds})\n'
        'install(FILES package.xml DESTINATION share/slow)\n',
    )


def test_an_interrupted_build_leaves_no_process(other):
    slow_package(other, 60)

    def interrupt() -> None:
        wait_for((other.path / 'build/slow/started').exists, timeout_s=60)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        other.build()
    thread.join()
    wait_for(lambda: processes_of(other.path) == [], timeout_s=2)


def test_a_build_that_was_begun_goes_on_beside_the_notebook_and_a_terminal_waits_for_it(other):
    slow_package(other, 1)
    begun = other.begin_build('slow')
    assert not (other.path / 'install/slow/share').exists()
    assert 'slow' in other.terminal('ls install/slow/share')
    result = begun.result()
    assert result.ok, result
    assert begun.result() is result


def test_a_build_that_was_begun_ends_with_its_workspace(other):
    slow_package(other, 60)
    other.begin_build('slow')
    wait_for((other.path / 'build/slow/started').exists, timeout_s=60)
    other.close()
    wait_for(lambda: processes_of(other.path) == [], timeout_s=2)


# --- The lines that matter -----------------------------------------------------------------------

# What builds with one mistake printed, and what of it is kept.
MESSAGES = {
    'a program of CMake': (
        """\
CMake Error at .../rosidl_adapt_interfaces.cmake:57 (message):
  execute_process(.../bin/python -m rosidl_adapter)
  returned error code 1:

  Traceback (most recent call last):

    File "<frozen runpy>", line 198, in _run_module_as_main
    File "rosidl_adapter/parser.py", line 851, in parse_service_string
      raise InvalidServiceSpecification(

  rosidl_adapter.parser.InvalidServiceSpecification: Could not find separator
  '---' between request and response

Call Stack (most recent call first):
  .../rosidl_generate_interfaces.cmake:132 (rosidl_adapt_interfaces)
  CMakeLists.txt:8 (rosidl_generate_interfaces)


CMake Error at CMakeLists.txt:9 (message):
  execute_process(.../bin/python -m silent)
  returned error code 1:
""",
        """\
CMake Error at .../rosidl_adapt_interfaces.cmake:57 (message):
  Traceback (most recent call last):
    ...
    File "rosidl_adapter/parser.py", line 851, in parse_service_string
      raise InvalidServiceSpecification(
  rosidl_adapter.parser.InvalidServiceSpecification: Could not find separator '---' between
  request and response
  called from CMakeLists.txt:8 (rosidl_generate_interfaces)""",
    ),
    'two tracebacks': (
        """\
Traceback (most recent call last):
  File "first.py", line 1, in <module>
    first
KeyError: 'first'

During handling of the above exception, another exception occurred:

Traceback (most recent call last):
  File "main.py", line 3, in <module>
    parse(text)
    ~~~~~^^^^^^
  File ".../lib/python3/ast.py", line 50, in parse
    return compile(source)
SyntaxError: one line
and a second one
gmake[2]: *** [CMakeFiles/a.dir/build.make:76: a.c] Error 1
""",
        """\
Traceback (most recent call last):
  ...
  File "main.py", line 3, in <module>
    parse(text)
SyntaxError: one line
and a second one""",
    ),
    'a compiler': (
        """\
CMake Warning:
  Manually-specified variables were not used by the project:

src/broken/main.cpp: In function 'int main()':
src/broken/main.cpp:2:10: error: 'missing' was not declared in this scope
    2 |   return missing;
      |          ^~~~~~~
src/broken/main.cpp:1:1: note: declared here
src/broken/main.cpp:2:10: error: 'missing' was not declared in this scope
    2 |   return missing;
gmake[2]: *** [CMakeFiles/a.dir/build.make:76: CMakeFiles/a.dir/main.cpp.o] Error 1
src/broken/other.cpp:2:10: error: of another job
""",
        """\
src/broken/main.cpp:2:10: error: 'missing' was not declared in this scope
    2 |   return missing;
      |          ^~~~~~~""",
    ),
    'nothing that is known': (
        '\n\n'.join(f'line {number}' for number in range(20)),
        '\n'.join(f'line {number}' for number in range(12, 20)),
    ),
}


@pytest.mark.parametrize(('text', 'kept'), MESSAGES.values(), ids=MESSAGES)
def test_the_lines_that_matter(text, kept):
    assert lines_that_matter(text) == kept.splitlines()


# --- The wheels ----------------------------------------------------------------------------------

EXPORT = 'INTERFACE_INCLUDE_DIRECTORIES "{0}/include/python3.11;{0}/lib/python3.11/{1}"\n'
BUILT_AT = '/opt/python/cp311-cp311'


def test_wheels_are_fixed_once_outside_the_cache(tmp_path):
    cached = tmp_path / 'cached'
    cached.write_text(EXPORT.format(BUILT_AT, 'site-packages/numpy/_core/include'))
    cached.chmod(0o640)
    file = tmp_path / 'share/a_msgs/cmake/a_msgsExport.cmake'
    file.parent.mkdir(parents=True)
    os.link(cached, file)  # as uv installs
    fix_wheels(tmp_path)
    include, numpy = re.search('"(.*)"', file.read_text())[1].split(';')
    assert Path(include).is_dir()
    assert (Path(numpy) / 'numpy/arrayobject.h').is_file()
    assert BUILT_AT in cached.read_text()
    fixed = file.stat()
    assert fixed.st_mode == cached.stat().st_mode
    fix_wheels(tmp_path)
    assert file.stat() == fixed


# --- Use -----------------------------------------------------------------------------------------


@pytest.fixture
def used(built, monkeypatch):
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH'):
        monkeypatch.setenv(name, os.environ.get(name, ''))
    monkeypatch.setattr(sys, 'path', [*sys.path])  # later tests do not find its packages
    built.use()
    return built


def test_tf2_msgs_is_built_anew_where_an_emptied_workspace_had_it(other, monkeypatch, tmp_path):
    module = tmp_path / 'tf2_msgs/__init__.py'
    module.parent.mkdir()
    module.touch()
    monkeypatch.syspath_prepend(tmp_path)
    loaded = module_from_spec(find_spec('tf2_msgs'))
    monkeypatch.setitem(sys.modules, 'tf2_msgs', loaded)
    begin_tf2_msgs(other)
    assert not (other.path / 'src/tf2_msgs').exists()
    module.unlink()
    begin_tf2_msgs(other)
    assert (other.path / 'src/tf2_msgs/package.xml').is_file()


def test_tf2_msgs_is_built_anew_if_its_build_was_stopped(other, monkeypatch):
    monkeypatch.setattr(tf2_msgs, '_is_there', lambda: False)
    begin_tf2_msgs(other)
    other.begin_anew()
    begun = []
    monkeypatch.setattr(other, 'begin_build', lambda *_: begun.append(True) or built_at_once())
    monkeypatch.setattr(other, 'use', lambda: None)
    provide_tf2_msgs(other)
    assert begun == [True]


def built_at_once():
    return SimpleNamespace(stopped=False, result=lambda: SimpleNamespace(ok=True))


def test_a_built_library_is_one_of_this_process(used):
    assert get_package_share_directory('number_pkg').startswith(str(used.path))
    assert ctypes.CDLL(None).doubled() == 42


def test_a_rebuilt_package_is_used_or_refused(used):
    import talker_pkg.talker

    assert talker_pkg.talker.GREETING == 'Hello World'
    path = list(sys.path)
    write_talker(used, talker=TALKER.replace('Hello World', 'Good morning'))
    assert used.build('talker_pkg').packages == {'talker_pkg': 'finished'}, 'not the overlay'
    used.use()
    import talker_pkg.talker

    assert talker_pkg.talker.GREETING == 'Good morning'
    assert sorted(sys.path) == sorted(path)  # nothing twice

    extension = used.path / 'install/number_pkg/lib/python3/site-packages/number_pkg/extension.so'
    old = extension.read_bytes()
    extension.write_bytes(old + b'\0')
    with pytest.raises(RuntimeError, match='^This kernel has loaded an older number_pkg: restart'):
        used.use()
    extension.write_bytes(old)
    used.use()


def test_without_a_build_one_sentence(other):
    with pytest.raises(RuntimeError, match=r'^Nothing has been built: call build\(\) first'):
        other.use()


# --- Run -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('shared_id', [None, 101])
def test_a_node_is_heard_and_ends(built, shared_id):
    with ros_session(shared_id) as session, built.run('talker_pkg', 'talker') as talker:
        listener = Listener()
        spin(session, listener)
        session.wait_until(lambda: len(listener.heard) > 2)
        assert talker.wait_for('Publishing: 2') == '[INFO] [talker]: Publishing: 2'
        assert talker.running
        (process,) = processes_of(built.path)
        environment = process.environ()
        assert environment['ROS_DOMAIN_ID'] == str(shared_id or reserve_domain_id())
        assert not HOSTILE.items() & environment.items()
    assert not talker.running
    # It was interrupted as with Ctrl+C, and could say its last words.
    assert talker.lines[-1] == 'The talker ends.'
    assert (built.path / 'log/ros').is_dir()


def test_the_same_run_again_ends_the_one_before(built):
    first = built.run('talker_pkg', 'talker')
    first.wait_for('Publishing')
    second = built.run('talker_pkg', 'talker')
    assert not first.running
    third = built.run('talker_pkg', 'talker', '--ros-args', '-r', '__node:=another')
    third.wait_for('[another]: Publishing')
    assert second.running
    built.close()
    assert not second.running
    assert not third.running


def test_waiting_is_bounded_and_says_what_was_printed(built):
    with built.run('talker_pkg', 'talker') as talker:
        talker.wait_for('Publishing: 1')
        said = r"^Waited 0.1 s, but talker did not print 'never'. Its last lines: .*Publish"
        with pytest.raises(TimeoutError, match=said):
            talker.wait_for('never', timeout_s=0.1)
        with pytest.raises(TimeoutError, match='^Waited 0.1 s, but talker did not end. Its'):
            talker.wait(timeout_s=0.1)


def test_commands_that_go_on_for_ever_are_ended_and_the_message_says_how_to_run_them(
    built, monkeypatch
):
    monkeypatch.setattr('helpers.workspace.workspace.TERMINAL_LIMIT_S', 0.3)
    lines = []
    with pytest.raises(TimeoutError, match='^After 0.3 s the commands had not ended.*`timeout 5`'):
        built.terminal('echo begun; sleep 60', show=lines.append)
    assert lines == ['begun\n']


def run_script(workspace: Workspace, name: str, text: str) -> Process:
    file = f'install/talker_pkg/lib/talker_pkg/{name}'
    workspace.write(file, f'#!/bin/sh\n{text}\n')
    workspace.file(file).chmod(0o755)
    return workspace.run('talker_pkg', name)


def test_a_traceback_is_reported_by_its_last_line(built):
    wrong = run_script(built, 'wrong.sh', f"""exec {sys.executable} -c 'int("a" + str(1))'""")
    with pytest.raises(RuntimeError) as failure:
        wrong.wait_for('up')
    said = "Its last line: ValueError: invalid literal for int() with base 10: 'a1'"
    assert str(failure.value) == f"wrong.sh ended with code 1 before a line with 'up'. {said}"


def test_deaf_and_orphaned_processes_are_killed(built, monkeypatch):
    ignores = 'trap "" INT TERM; printf "up "; echo and running; sleep 60; true'
    with monkeypatch.context() as impatient, run_script(built, 'deaf.sh', ignores) as deaf:
        impatient.setattr(processes, 'STOP_TIMEOUT_S', 0.3)
        assert deaf.wait_for('up') == 'up and running'
    assert deaf.wait() == -signal.SIGKILL
    # `wait`, because a SIGINT while dash starts a command, such as sleep, is lost.
    with run_script(built, 'leaving.sh', f'({ignores}) & wait') as leaving:
        leaving.wait_for('up')
    assert leaving.wait() == -signal.SIGINT
    wait_for(lambda: processes_of(built.path) == [], timeout_s=2)


def test_a_package_whose_build_was_interrupted_is_aborted(tmp_path):
    events = tmp_path / 'events.log'
    events.write_text(
        '[0.1] (done) JobQueued: {}\n[0.1] (broken) JobQueued: {}\n'
        '[0.1] (stopped) JobQueued: {}\n[0.1] (waits) JobQueued: {}\n'
        "[0.2] (done) JobEnded: {'identifier': 'done', 'rc': 0}\n"
        "[0.2] (broken) JobEnded: {'identifier': 'broken', 'rc': 1}\n"
        "[0.2] (stopped) JobEnded: {'identifier': 'stopped', 'rc': 'SIGINT'}\n"
    )
    assert _packages(events) == {
        'done': 'finished',
        'broken': 'failed',
        'stopped': 'aborted',
        'waits': 'aborted',
    }


def test_a_killed_kernel_takes_its_nodes_with_it(built):
    script = f"""
        from helpers.workspace import Workspace
        workspace = Workspace('test_killed')
        (workspace.path / 'install').symlink_to('{built.path}/install')
        workspace.run('talker_pkg', 'talker').wait_for('Publishing')
        print(workspace.path, flush=True)
        input()
    """
    with running(script) as kernel:
        path = Path(kernel.stdout.readline().strip())
        assert len(processes_of(path)) == 1
        kernel.kill()
        kernel.wait()
        wait_for(lambda: processes_of(path) == [], timeout_s=60)


def test_an_interrupt_while_a_process_starts_leaves_none(built, shell, monkeypatch):
    built.environment()
    started = []

    class Interrupted(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)
            signal.raise_signal(signal.SIGINT)

    for start in (
        lambda: built.run('talker_pkg', 'talker'),
        lambda: built.build('talker_pkg'),
        built.environment,  # its shell starts once after each build
        lambda: Process('sleep', ['sleep', '60'], dict(os.environ), built.path),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(subprocess, 'Popen', Interrupted)
            shell.user_ns['start'] = start
            cell = shell.run_cell('start()')
        assert isinstance(cell.error_in_exec, KeyboardInterrupt)
    assert [process.poll() is None for process in started] == [False] * 4


# When it has to end, it first interrupts its parent, and takes its time.
INTERRUPTS = """
import os, signal, sys, time
def end(*_):
    os.kill(os.getppid(), signal.SIGINT)
    time.sleep(1)
    sys.exit()
signal.signal(signal.SIGINT, end)
print('ready', flush=True)
time.sleep(60)
"""


def test_an_interrupt_while_a_process_ends_leaves_none(tmp_path):
    process = Process('slow', [sys.executable, '-c', INTERRUPTS], dict(os.environ), tmp_path)
    process.wait_for('ready')
    with pytest.raises(KeyboardInterrupt):
        process.stop()
    assert psutil.Process().children() == []


# At each Ctrl+C it says so. It ends after some time, or never.
SLOW = """
import signal, sys, time
def end(*_):
    print('Ctrl+C', flush=True)
    time.sleep(0.3)
    sys.exit() if {ends} else None
signal.signal(signal.SIGINT, end)
print('ready', flush=True)
while True:
    time.sleep(1)
"""


@pytest.mark.parametrize('ends', [True, False])
def test_an_interrupted_process_has_time_to_end_and_is_not_killed(ends, tmp_path, monkeypatch):
    monkeypatch.setattr(processes, 'STOP_TIMEOUT_S', 0.1)
    command = [sys.executable, '-c', SLOW.format(ends=ends)]
    with Process('slow', command, dict(os.environ), tmp_path) as process:
        process.wait_for('ready')
        process.interrupt(limit_s=5 if ends else 0.6)
        assert process.running != ends
        assert process.lines == ['ready', 'Ctrl+C']
    process.interrupt()  # it has ended


# --- Terminals -----------------------------------------------------------------------------------


def test_a_terminal_knows_packages_after_source(built):
    assert built.terminal('ros2 run talker_pkg talker') == "Package 'talker_pkg' not found"
    source = 'source install/setup.bash; '
    executables = built.terminal(f'{source}ros2 pkg executables talker_pkg')
    assert 'talker_pkg talker' in executables.splitlines()
    with built.start(f'{source}ros2 run talker_pkg talker', 'first') as talker:
        talker.wait_for('Publishing: 2')
        assert built.terminal('ros2 node list') == '/talker'
        again = built.start('echo again', 'first')
        assert not talker.running
        assert again.wait() == 0
    assert talker.lines[-1] == 'The talker ends.'


def test_a_wait_that_gives_up_names_topics_that_do_not_meet(other):
    publish = 'ros2 topic pub /topik std_msgs/msg/String "data: a"'
    with (
        other.start(publish, 'publish') as publisher,
        other.start('ros2 topic echo /topic std_msgs/msg/String', 'echo') as echo,
    ):
        publisher.wait_for('publishing')
        listens = 'Subscription count: 1'
        wait_for(lambda: listens in other.terminal('ros2 topic info /topic'), timeout_s=60)
        with pytest.raises(TimeoutError) as failure:
            echo.wait_for('data', timeout_s=1)
    waited, *topics = str(failure.value).split('The topic ')
    assert 'echo' in waited
    assert "'data'" in waited
    said = dict(topic.split(maxsplit=1) for topic in topics)
    assert said.keys() == {'/topik', '/topic'}
    assert 'no subscription' in said['/topik']
    assert '/topic' in said['/topik']
    assert 'no publisher' in said['/topic']
    assert '/topik' in said['/topic']


def test_a_killed_kernel_closes_its_terminals(built):
    script = f"""
        from helpers.workspace import Workspace
        workspace = Workspace('test_killed')
        (workspace.path / 'install').symlink_to('{built.path}/install')
        run = 'source install/setup.bash; ros2 run talker_pkg talker; true'
        workspace.start(run).wait_for('Publishing')
        print(workspace.path, flush=True)
        input()
    """
    with running(script) as kernel:
        path = Path(kernel.stdout.readline().strip())
        assert len(processes_of(path)) > 1
        kernel.kill()
        kernel.wait()
        wait_for(lambda: processes_of(path) == [], timeout_s=60)


# --- The folder ----------------------------------------------------------------------------------


def test_a_terminal_starts_clean_in_the_workspace(other, monkeypatch):
    monkeypatch.setenv('GIT_DIR', '/proc')
    monkeypatch.setenv('PYTHONPATH', '/proc')
    said = other.terminal('cd src; git init --quiet .; git status --short; pwd; echo "$PYTHONPATH"')
    assert said == 'src\n'
    assert other.terminal('pwd; false; echo two >&2') == '.\ntwo'
    assert 'not a git repository' in other.terminal('rm -rf src/.git; cd src; git status')


def test_a_run_without_a_person_begins_empty(other):
    other.write('src/a/b.txt', 'text')
    other.write('build/made.txt', 'text')
    again = Workspace(other.path.name)
    assert again.path == other.path
    assert list(again.path.rglob('*')) == [again.path / 'src']
    if again.path.is_relative_to(ROOT) and (ROOT / '.git').exists():
        subprocess.run(['git', 'check-ignore', '-q', again.path], cwd=ROOT, check=True)


@pytest.fixture
def mine(built, watched):
    """Return the workspace of a person, and leave nothing of it."""
    workspace = Workspace('test_workspace_person')
    yield workspace
    workspace.close()
    for folder in workspace.path.parent.glob(f'{workspace.path.name}*'):
        shutil.rmtree(folder)


@pytest.fixture
def watched(monkeypatch):
    monkeypatch.setattr('helpers.workspace.workspace.somebody_watches', lambda: True)


def test_a_person_finds_the_workspace_as_it_was_left(mine, capsys):
    mine.write('src/a.py', 'import os\n', part=1)
    mine.write('src/a.py', 'def main():\n', part=2)
    mine.file('src/by_hand.txt').write_text('text')
    mine.write('install/made.txt', 'text')
    again = Workspace(mine.path.name)
    assert 'as you left them: 2 files in scratch/' in capsys.readouterr().out
    assert again.file('src/by_hand.txt').read_text() == 'text'
    assert again.file('install/made.txt').exists()
    again.write('src/a.py', 'def run():\n', part=2)
    assert again.file('src/a.py').read_text() == 'import os\n\n\ndef run():\n'


def test_to_begin_anew_keeps_a_copy_each_time(mine, capsys):
    for text in ('one', 'two'):
        mine.write('src/a.txt', text)
        mine.begin_anew()
        assert not mine.file('src/a.txt').exists()
    mine.begin_anew()
    first, second, nothing = capsys.readouterr().out.splitlines()
    name = f'scratch/{mine.path.name}.before'
    assert first.endswith(f'1 file and what was built are gone from it. A copy is in {name}_1.')
    assert second.endswith(f'{name}_2.')
    assert nothing.endswith('There was nothing in it.')
    for number, text in ((1, 'one'), (2, 'two')):
        kept = mine.path.with_name(f'{mine.path.name}.before_{number}')
        assert (kept / 'src/a.txt').read_text() == text


def test_a_run_without_a_person_puts_aside_what_one_has_left(mine, monkeypatch):
    mine.write('src/a.txt', 'text')
    monkeypatch.setattr('helpers.workspace.workspace.somebody_watches', lambda: False)
    again = Workspace(mine.path.name)
    assert not again.file('src/a.txt').exists()
    kept = again.path.with_name(f'{again.path.name}.before_1')
    assert (kept / 'src/a.txt').read_text() == 'text'


def test_two_kernels_do_not_share_a_folder():
    """Not even if the other kernel has been killed, and its build goes on."""
    script = """
        from helpers.workspace import Workspace
        from support.packages import write_talker
        workspace = Workspace('test_outlives')
        write_talker(workspace)
        print(workspace.path, flush=True)
        workspace.build()
    """
    with running(script) as kernel:
        path = Path(kernel.stdout.readline().strip())
        wait_for(lambda: processes_of(path), timeout_s=60)
        build = processes_of(path)[0]
        kernel.kill()
        kernel.wait()
        build.suspend()
        assert folders.claim_workspace(path.name) != path
        build.resume()
        build.wait(timeout=60)
        assert folders.claim_workspace(path.name) == path


def test_a_checkout_with_spaces_and_accents(other, monkeypatch, tmp_path):
    checkout = tmp_path / 'élève one'
    checkout.mkdir()
    monkeypatch.setattr(folders, 'ROOT', checkout)
    workspace = Workspace('test_accents')
    assert re.fullmatch(r'[A-Za-z0-9_./-]+', str(workspace.path))
    assert list(checkout.iterdir()) == []


@pytest.mark.parametrize(
    ('script', 'write', 'file'),
    [
        ('FLEET', given.write_fleet, 'src/fleet_pkg/package.xml'),
        ('COLLEAGUE', given.play_colleague, 'server/brake.git/HEAD'),
    ],
)
def test_files_of_somebody_else_come_from_such_a_checkout(
    other, monkeypatch, tmp_path, script, write, file
):
    checkout = tmp_path / 'élève one'
    checkout.mkdir()
    monkeypatch.setattr(given, script, Path(shutil.copy(getattr(given, script), checkout)))
    write(other)
    assert (other.path / file).is_file()


@pytest.mark.parametrize('name', ['', 'two words', '../up'])
def test_names_of_workspaces(name):
    with pytest.raises(ValueError, match='Name a workspace with letters'):
        Workspace(name)


def test_an_overlay_replaces_no_folder_of_its_underlay(other):
    other.write('src/package/package.xml', 'text')
    with pytest.raises(ValueError, match=r"^'src' is a folder of the underlay: choose another"):
        Workspace('src', underlay=other)
    assert other.file('src/package/package.xml').read_text() == 'text'


@pytest.mark.parametrize('path', ['/etc/passwd', 'src/../../up', ''])
def test_a_file_stays_in_its_workspace(other, path):
    with pytest.raises(ValueError, match='Give a path inside the workspace'):
        other.write(path, 'text')


# --- In a notebook -------------------------------------------------------------------------------


def test_several_cells_write_one_file(shell, capsys):
    file = Workspace('test_workspace_other').file('src/a b.py')
    shell.run_cell('%%write src/a b.py part 2\nlast = 1\n')
    assert 'Write part 1 of src/a b.py first.' in capsys.readouterr().err
    assert not file.exists()
    for part, text in ((1, 'first = 1'), (2, 'last = 1'), (2, 'last = 2'), (1, '# é')):
        shell.run_cell(f'%%write src/a b.py part {part}\n{text}\n')
        assert capsys.readouterr().out == f'Wrote part {part} of src/a b.py\n'
    assert file.read_text(encoding='utf-8') == '# é\n\nlast = 2\n'
    for part, text in ((1, 'import time'), (2, 'def main():\n    pass')):
        shell.run_cell(f'%%write src/node.py part {part}\n{text}\n')
    assert file.with_name('node.py').read_text() == 'import time\n\n\ndef main():\n    pass\n'
    capsys.readouterr()
    shell.run_cell('%%write src/a b.py\nwhole = 1\n')
    shell.run_cell('%%write src/a b.py part 2\nlast = 3\n')
    assert file.read_text() == 'whole = 1\n'
    shell.run_cell('%%write ../up\ntext\n')
    assert 'Give a path inside the workspace' in capsys.readouterr().err


def test_cells_are_terminals(shell, capsys):
    workspace = Workspace('test_workspace_other')
    shell.run_cell('%%terminal\necho one; ls')
    assert capsys.readouterr().out == 'one\nsrc\n'
    # What is printed is there at once, and an Interrupt loses none of it.
    shell.run_cell('import _thread, threading\nthreading.Timer(1, _thread.interrupt_main).start()')
    shell.run_cell('%%terminal\necho early; sleep 60; echo late')
    assert capsys.readouterr().out.startswith('early\n')
    shell.run_cell('%%terminal a_name\nsleep 60')
    assert workspace.terminals['a_name'].running
    workspace.close()
    assert workspace.terminals == {}


def test_an_interrupted_cell_ends_its_processes(shell, built):
    workspace = Workspace('test_workspace_other')
    (workspace.path / 'install').symlink_to(built.path / 'install')

    def start():
        talker = workspace.run('talker_pkg', 'talker')
        talker.wait_for('Publishing')
        return talker

    shell.push({'start': start})
    shell.run_cell('first = start()')
    shell.run_cell('raise KeyboardInterrupt')
    assert shell.user_ns['first'].running  # a later cell does not end it
    shell.run_cell('second = start(); raise KeyboardInterrupt')
    assert not shell.user_ns['second'].running
    third = start()
    shell.events.trigger('post_run_cell', None)  # what IPython does outside the cell
    assert not third.running


def test_a_tree_has_folders_in_one_line_but_not_their_files(capsys):
    workspace = Workspace('test_workspace_tree')
    workspace.write('src/one/two/three.py', '')
    workspace.write('src/one/two/four.py', '')
    workspace.write('src/five/six.py', '')
    capsys.readouterr()
    workspace.print_tree()
    assert capsys.readouterr().out.splitlines() == [
        *('src/', '  five/', '    six.py', '  one/two/', '    four.py', '    three.py'),
    ]
    shutil.rmtree(workspace.path)
