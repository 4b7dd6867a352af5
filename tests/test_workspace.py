"""Workspaces, with real builds. Most tests look at the packages of one build."""

import os
import re
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
from support.processes import kill

from helpers import workspace as module
from helpers.domain import reserve_domain_id
from helpers.session import ros_session
from helpers.workspace import Workspace, lines_that_matter, mend_wheels, missing_tools

ROOT = Path(__file__).resolve().parent.parent

PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>For a test</description>
  <maintainer email="user@example.com">user</maintainer>
  <license>Apache-2.0</license>
  {depends}
  <export>
    <build_type>{build_type}</build_type>
  </export>
</package>
"""
INTERFACE_DEPENDS = """\
<buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>sensor_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
"""
CMAKE_LISTS = """\
cmake_minimum_required(VERSION 3.8)
project(custom_interfaces)

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(sensor_msgs REQUIRED)

rosidl_generate_interfaces(${PROJECT_NAME}
  "srv/TurnCamera.srv"
  DEPENDENCIES sensor_msgs
)

ament_package()
"""
SETUP_PY = """\
from setuptools import find_packages, setup

package_name = 'talker_pkg'

setup(
    name=package_name,
    version='0.0.0',
    packages=find_packages(),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    entry_points={'console_scripts': ['talker = talker_pkg.talker:main']},
)
"""
SETUP_CFG = """\
[develop]
script_dir=$base/lib/talker_pkg
[install]
install_scripts=$base/lib/talker_pkg
"""
TALKER = """\
import rclpy
from rclpy.node import Node
from std_msgs.msg import String

GREETING = 'Hello World'


class Talker(Node):
    def __init__(self):
        super().__init__('talker')
        self.publisher = self.create_publisher(String, 'topic', 10)
        self.count = 0
        self.timer = self.create_timer(0.05, self.tick)

    def tick(self):
        self.publisher.publish(String(data=f'{GREETING}: {self.count}'))
        self.get_logger().info(f'Publishing: {self.count}')
        self.count += 1


def main():
    rclpy.init()
    node = Talker()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        print('The talker ends.')
"""


def write_interfaces(workspace: Workspace, folder='custom_interfaces', cmake=CMAKE_LISTS) -> None:
    top = f'src/{folder}'
    xml = PACKAGE_XML.format(
        name='custom_interfaces', depends=INTERFACE_DEPENDS, build_type='ament_cmake'
    )
    workspace.write(f'{top}/package.xml', xml)
    workspace.write(f'{top}/CMakeLists.txt', cmake)
    workspace.write(
        f'{top}/srv/TurnCamera.srv', 'float32 deg_turn\n---\nsensor_msgs/Image camera_image\n'
    )


def write_talker(workspace: Workspace, setup=SETUP_PY, talker=TALKER) -> None:
    depends = '<depend>rclpy</depend>'
    xml = PACKAGE_XML.format(name='talker_pkg', depends=depends, build_type='ament_python')
    workspace.write('src/talker_pkg/package.xml', xml)
    workspace.write('src/talker_pkg/setup.py', setup)
    workspace.write('src/talker_pkg/setup.cfg', SETUP_CFG)
    workspace.write('src/talker_pkg/resource/talker_pkg', '')
    workspace.write('src/talker_pkg/talker_pkg/__init__.py', '')
    workspace.write('src/talker_pkg/talker_pkg/talker.py', talker)


# What a student's terminal may have set. It must not reach a build or a node.
HOSTILE = {
    'CLICOLOR_FORCE': '1',
    'FORCE_COLOR': '1',
    'AMENT_PREFIX_PATH': '/opt/ros/humble',
    'CMAKE_PREFIX_PATH': '/opt/ros/humble',
    'COLCON_DEFAULTS_FILE': '/nowhere/defaults.yaml',
    'COLCON_LOG_PATH': '/nowhere/log',
    'COLCON_EXTENSION_BLOCKLIST': 'colcon_core.verb.build',
    'CXXFLAGS': '--no-such-option',
    'CMAKE_GENERATOR': 'No Such Generator',
    'DESTDIR': '/nowhere',
    'HOME': '/proc',  # nobody can write there
    'LC_ALL': 'de_DE.UTF-8',
    'MAKEFLAGS': '--no-such-option',
    'PYTHONPATH': '/opt/ros/humble/lib/python3.10/site-packages',
    'RMW_IMPLEMENTATION': 'rmw_no_such',
    'ROS_DOMAIN_ID': '77',
}


@pytest.fixture(scope='module')
def built():
    """Return a workspace in which an interface package and a Python package have been built."""
    if lacking := missing_tools():
        pytest.fail(lacking)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in HOSTILE.items():
            patch.setenv(name, value)
        workspace = Workspace('test_workspace')
        write_interfaces(workspace)
        write_talker(workspace)
        workspace.result = workspace.build()
        workspace.environment()  # sourced in the hostile environment, and kept
    yield workspace
    workspace.close()


@pytest.fixture
def other(built):
    """Return a workspace for a build that fails. The one of `built` stays as it is."""
    kept = module._open_workspace
    module._open_workspace = None
    workspace = Workspace('test_workspace_errors')
    yield workspace
    workspace.close()
    module._open_workspace = kept


# --- Build ---------------------------------------------------------------------------------------


def test_a_build_says_what_was_built_and_nothing_that_changes(built):
    assert str(built.result) == (
        'colcon build\n'
        'Finished <<< custom_interfaces\n'
        'Finished <<< talker_pkg\n'
        '\n'
        'Summary: 2 packages finished'
    )
    assert repr(built.result) == str(built.result)
    assert built.result.ok
    assert built.result.failed is None
    assert built.result.log.is_file()
    assert 0 < built.result.seconds < 120


def test_a_forgotten_dependency_is_the_key_error(other):
    write_interfaces(other, cmake=CMAKE_LISTS.replace('  DEPENDENCIES sensor_msgs\n', ''))
    result = other.build('custom_interfaces')
    assert not result.ok
    assert result.failed == 'custom_interfaces'
    assert result.errors[0] == 'Traceback (most recent call last):'
    assert 'rosidl_generator_type_description/__init__.py' in result.errors[2]
    assert result.errors[-1] == "KeyError: 'sensor_msgs'"
    assert len(result.errors) < 7
    assert str(result).startswith('colcon build --packages-select custom_interfaces\n')
    assert str(result).endswith(
        'Summary: 0 packages finished\n'
        '  1 package failed: custom_interfaces\n'
        'Every line: log/latest_build/custom_interfaces/stdout_stderr.log'
    )
    for folder in (str(other.path), sys.prefix, sys.base_prefix, str(Path.home())):
        assert f'{folder}/' not in str(result)
    assert '***' in result.log.read_text()  # make's own lines are in the log only


def test_a_forgotten_find_package_is_an_unknown_command(other):
    forgotten = 'find_package(rosidl_default_generators REQUIRED)\n'
    write_interfaces(other, cmake=CMAKE_LISTS.replace(forgotten, ''))
    assert other.build().errors == [
        'CMake Error at CMakeLists.txt:7 (rosidl_generate_interfaces):',
        '  Unknown CMake command "rosidl_generate_interfaces".',
    ]


def test_a_wrong_service_file_names_the_mistake(other):
    write_interfaces(other)
    other.write('src/custom_interfaces/srv/TurnCamera.srv', 'float32 deg_turn\n--\n')
    text = ' '.join(' '.join(other.build().errors).split())
    assert "InvalidServiceSpecification: Could not find separator '---' between request" in text
    assert 'called from CMakeLists.txt:8 (rosidl_generate_interfaces)' in text
    assert 'execute_process' not in text


def test_a_compiler_error_is_its_line(other):
    other.write(
        'src/broken/CMakeLists.txt',
        'cmake_minimum_required(VERSION 3.8)\nproject(broken CXX)\nadd_executable(a main.cpp)\n',
    )
    other.write('src/broken/main.cpp', 'int main() {\n  return missing;\n}\n')
    depends = '<buildtool_depend>cmake</buildtool_depend>'
    xml = PACKAGE_XML.format(name='broken', depends=depends, build_type='cmake')
    other.write('src/broken/package.xml', xml)
    errors = other.build('broken').errors
    assert re.match(r'src/broken/main.cpp:2:10: error: .missing. was not declared', errors[0])
    assert any('return missing;' in line for line in errors)
    assert not any('***' in line for line in errors)


def test_mistakes_of_a_python_package(other):
    write_talker(other, setup=SETUP_PY.replace("'resource/'", "'resources/'"))
    assert other.build().errors == [
        "error: can't copy 'resources/talker_pkg': doesn't exist or not a regular file"
    ]
    write_talker(other, setup=SETUP_PY.replace('setup(\n', 'setup((\n'))
    assert other.build().errors[-1].startswith('SyntaxError: ')

    marker = "('share/ament_index/resource_index/packages', ['resource/' + package_name]),"
    write_talker(other, setup=SETUP_PY.replace(marker, ''))
    result = other.build()
    assert result.ok
    assert "doesn't explicitly install a marker in the package index" in str(result)

    result = other.build('talker')
    assert not result.ok
    assert result.errors == ['Nothing was built: src/ has no package talker, only talker_pkg.']

    (other.path / 'src').rename(other.path / 'elsewhere')
    result = other.build('talker')
    assert result.errors == ['Nothing was built: src/ has no package talker, it is empty.']


def test_an_interrupted_build_leaves_no_process(other):
    write_interfaces(other)
    generated = other.path / 'build/custom_interfaces/rosidl_generator_c'

    def interrupt() -> None:
        wait_until(generated.exists, timeout_s=60)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        other.build()
    thread.join()
    assert generated.exists()
    assert [p for p in psutil.process_iter(['cmdline']) if belongs_to(other, p)] == []


def belongs_to(workspace: Workspace, process: psutil.Process) -> bool:
    return any(str(workspace.path) in word for word in process.info['cmdline'] or [])


def test_arguments_that_are_no_packages(built):
    with pytest.raises(TypeError, match='given by its name'):
        built.build(['talker_pkg'])
    with pytest.raises(ValueError, match='is not the name of a package'):
        built.build('--symlink-install')


def test_without_a_compiler_one_sentence_says_what_to_install(other, monkeypatch, tmp_path):
    write_interfaces(other)
    # Only what belongs to this Python is left.
    monkeypatch.setenv('PATH', str(tmp_path))
    with pytest.raises(RuntimeError, match=r'^There is no C\+\+ compiler: run `sudo apt install g'):
        other.build()
    for name in ('c++', 'cc'):
        (tmp_path / name).symlink_to('/bin/sh')
    assert missing_tools() == (
        'There is no make: run `sudo apt install make`, then run this cell again.'
    )
    assert missing_tools(cmake=False) == ''


def test_without_python_headers_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(module.sysconfig, 'get_path', lambda kind: '/nowhere')
    version = f'{sys.version_info.major}.{sys.version_info.minor}'
    assert f'run `sudo apt install python{version}-dev`' in missing_tools()


@pytest.mark.parametrize('ld', ['/usr/bin/ld', '/usr/bin/x86_64-linux-gnu-ld.bfd'])
def test_of_the_linker_only_its_error_is_kept(ld):
    error = (
        f'{ld}: lib/libmy.a(my.cpp.o): relocation R_X86_64_PC32 against symbol `_ZTISt9'
        "exception' can not be used when making a shared object; recompile with -fPIC"
    )
    text = f"""{ld}: lib/libmy.a(my.cpp.o): warning: relocation against `_ZTISt9exception'
{error}
{ld}: final link failed: bad value
collect2: error: ld returned 1 exit status
gmake[2]: *** [CMakeFiles/my.dir/build.make:100: my.so] Error 1"""
    assert lines_that_matter(text) == [error]


def test_without_known_lines_the_last_ones_are_kept():
    text = '\n'.join(f'line {number}' for number in range(20))
    assert lines_that_matter(text) == [f'line {number}' for number in range(12, 20)]


# --- The wheels ----------------------------------------------------------------------------------

EXPORT = 'INTERFACE_INCLUDE_DIRECTORIES "{0}/include/python3.11;{0}/lib/python3.11/{1}"\n'


def test_the_wheels_are_mended_once_and_their_cache_is_not_touched(tmp_path):
    built_at = '/opt/python/cp311-cp311'
    cached = tmp_path / 'cached'
    cached.write_text(EXPORT.format(built_at, 'site-packages/numpy/_core/include'))
    file = tmp_path / 'share/a_msgs/cmake/a_msgsExport.cmake'
    file.parent.mkdir(parents=True)
    os.link(cached, file)  # as uv installs
    assert mend_wheels(tmp_path) == 1
    folders = re.search('"(.*)"', file.read_text())[1].split(';')
    assert [Path(folder).is_dir() for folder in folders] == [True, True]
    assert (Path(folders[1]) / 'numpy/arrayobject.h').is_file()
    assert built_at in cached.read_text()
    assert file.stat().st_mode == cached.stat().st_mode
    assert mend_wheels(tmp_path) == 0


def test_wheels_that_cannot_be_mended_get_one_sentence(tmp_path):
    file = tmp_path / 'share/a_msgs/cmake/a_msgsExport.cmake'
    file.parent.mkdir(parents=True)
    file.write_text(EXPORT.format('/opt/python/cp311-cp311', 'site-packages/numpy/_core/include'))
    # No file may have a byte: the same for root, whom a mode does not stop.
    answer = subprocess.run(
        [sys.executable, '-c', 'import sys; from helpers.workspace import mend_wheels as m; '
         'from pathlib import Path; m(Path(sys.argv[1]))', tmp_path],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)),
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert (
        'cannot be written: use an environment of your own, made with `make lab`.'
        in (answer.stderr.strip().splitlines()[-1])
    )
    assert [path.name for path in file.parent.iterdir()] == [file.name]


# --- Use -----------------------------------------------------------------------------------------


def test_a_built_interface_serves_a_call_in_this_process(built, monkeypatch):
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH'):
        monkeypatch.setenv(name, os.environ.get(name, ''))
    built.use()
    from ament_index_python import get_package_share_directory
    from custom_interfaces.srv import TurnCamera
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    assert get_package_share_directory('custom_interfaces').startswith(str(built.path))

    def turn(request, response):
        response.camera_image.header.frame_id = f'{request.deg_turn:g} degrees'
        return response

    with ros_session() as session:
        node = Node('camera')
        node.create_service(TurnCamera, 'turn_camera', turn)
        client = node.create_client(TurnCamera, 'turn_camera')
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        session.spin(executor)
        session.wait_until(client.service_is_ready)
        answer = client.call_async(TurnCamera.Request(deg_turn=90.0))
        session.wait_until(answer.done)
        assert answer.result().camera_image.header.frame_id == '90 degrees'


def test_what_was_built_again_is_used_or_the_kernel_must_be_restarted(built, monkeypatch):
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH'):
        monkeypatch.setenv(name, os.environ.get(name, ''))
    built.use()
    import talker_pkg.talker

    assert talker_pkg.talker.GREETING == 'Hello World'
    write_talker(built, talker=TALKER.replace('Hello World', 'Good morning'))
    assert built.build('talker_pkg').ok
    built.use()
    import talker_pkg.talker

    assert talker_pkg.talker.GREETING == 'Good morning'

    library = (
        built.path / 'install/custom_interfaces/lib/libcustom_interfaces__rosidl_generator_c.so'
    )
    old = library.read_bytes()
    library.unlink()
    library.write_bytes(old + b'\0')
    with pytest.raises(RuntimeError, match='^custom_interfaces has changed, .* restart the kernel'):
        built.use()
    library.unlink()
    library.write_bytes(old)
    built.use()


def test_without_a_build_one_sentence(other):
    with pytest.raises(RuntimeError, match=r'^Nothing has been built: call build\(\) first'):
        other.use()


# --- Run -----------------------------------------------------------------------------------------


def is_alive(pid: int) -> bool:
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except FileNotFoundError:
        return False


def wait_until(predicate, timeout_s=10.0) -> bool:
    end = time.monotonic() + timeout_s
    while not predicate() and time.monotonic() < end:
        time.sleep(0.01)
    return predicate()


@pytest.mark.parametrize('shared_id', [None, 101])
def test_a_running_node_is_heard_by_this_kernel_and_ends(built, shared_id):
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from std_msgs.msg import String

    heard = []
    with ros_session(shared_id) as session, built.run('talker_pkg', 'talker') as talker:
        node = Node('listener')
        node.create_subscription(String, 'topic', heard.append, 10)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        session.spin(executor)
        session.wait_until(lambda: len(heard) > 2)
        assert talker.wait_for('Publishing', count=3) == '[INFO] [talker]: Publishing: 2'
        assert talker.running
        assert repr(talker) == 'talker: running'
        environment = Path(f'/proc/{talker._process.pid}/environ').read_bytes().split(b'\0')
        assert f'ROS_DOMAIN_ID={shared_id or reserve_domain_id()}'.encode() in environment
        assert not [x for x in environment if b'humble' in x or b'rmw_no_such' in x]
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


def test_what_ros2_run_would_say(built, capsys):
    for names, told in {
        ('talker_pkg', 'walker'): 'No executable found',
        ('walker_pkg', 'talker'): "Package 'walker_pkg' not found",
    }.items():
        process = built.run(*names)
        assert (process.wait(), process.lines) == (1, [told])
    process.print_output()
    assert capsys.readouterr().out == "Package 'walker_pkg' not found\n"
    assert built.run('talker_pkg', 'talker', sourced=False).lines == [
        "Package 'talker_pkg' not found"
    ]


def test_waiting_is_bounded_and_says_what_was_printed(built):
    with built.run('talker_pkg', 'talker') as talker:
        talker.wait_for('Publishing')
        with pytest.raises(TimeoutError, match="a line with 'never' of talker. Its .*Publish"):
            talker.wait_for('never', timeout_s=0.1)
        kill(talker._process)
        with pytest.raises(RuntimeError, match='^talker ended with code -9 before a line'):
            talker.wait_for('never')


def test_of_a_traceback_the_last_line_is_told(built):
    command = [sys.executable, '-c', 'int("a" + str(1))']
    wrong = module.Process('wrong', command, dict(os.environ), built.path)
    with pytest.raises(RuntimeError) as failure:
        wrong.wait_for('up')
    told = "Its last line: ValueError: invalid literal for int() with base 10: 'a1'"
    assert str(failure.value) == f"wrong ended with code 1 before a line with 'up'. {told}"


def test_a_process_that_ignores_ctrl_c_is_killed(built, monkeypatch):
    monkeypatch.setattr(module, 'STOP_TIMEOUT_S', 0.3)
    code = 'import signal as s; [s.signal(n, s.SIG_IGN) for n in (2, 15)]; print("up"); s.pause()'
    command = [sys.executable, '-u', '-c', code]
    with module.Process('deaf', command, dict(os.environ), built.path) as deaf:
        deaf.wait_for('up')
    assert deaf.returncode == -signal.SIGKILL


def test_a_killed_kernel_takes_its_nodes_with_it(built):
    code = """
import sys
from helpers import workspace
from helpers.workspace import Workspace
workspace._empty = lambda folder: None
open_here = Workspace.__new__(Workspace)
open_here.path = workspace.Path(sys.argv[1])
open_here._processes, open_here._sourced = {}, None
process = open_here.run('talker_pkg', 'talker')
process.wait_for('Publishing')
print(process._process.pid, flush=True)
input()
"""
    kernel = subprocess.Popen(
        [sys.executable, '-c', code, built.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    pid = int(kernel.stdout.readline())
    assert is_alive(pid)
    kernel.kill()
    kernel.communicate()
    assert wait_until(lambda: not is_alive(pid))


# --- The folder ----------------------------------------------------------------------------------


def test_a_new_workspace_is_empty_and_git_does_not_see_it(other):
    other.write('src/a/b.txt', 'text')
    again = Workspace('test_workspace_errors')
    assert again.path == other.path
    assert [item.name for item in again.path.iterdir()] == ['src']
    assert list((again.path / 'src').iterdir()) == []
    if again.path.is_relative_to(ROOT) and (ROOT / '.git').exists():
        subprocess.run(['git', 'check-ignore', '-q', again.path], cwd=ROOT, check=True)


def test_two_kernels_do_not_share_a_folder(built):
    code = "from helpers.workspace import Workspace as W; print(W('test_workspace').path.name)"
    answer = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True
    )
    other = answer.stdout.strip()
    assert other.startswith('test_workspace')
    assert other != built.path.name
    assert built.result.log.is_file()


@pytest.mark.parametrize(
    ('first', 'start'),
    [
        (Workspace.environment, lambda workspace: workspace.run('talker_pkg', 'talker')),
        (Workspace.environment, lambda workspace: workspace.build('talker_pkg')),
        (Workspace.build, Workspace.environment),
    ],
    ids=['run', 'build', 'environment'],
)
def test_an_interrupt_while_a_process_starts_leaves_none(built, monkeypatch, first, start):
    first(built)  # the shell of `environment` starts once after each build
    started = []

    class Interrupted(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(subprocess, 'Popen', Interrupted)
    with pytest.raises(KeyboardInterrupt):
        start(built)
    monkeypatch.undo()
    built.close()  # as after each cell that was interrupted
    (process,) = started
    assert process.poll() is not None


def test_a_build_that_outlives_its_kernel_keeps_its_folder(other):
    code = """
from test_workspace import Workspace, write_talker
workspace = Workspace('test_outlives')
write_talker(workspace)
print(workspace.path.name, flush=True)
workspace.build()
"""
    kernel = subprocess.Popen(
        [sys.executable, '-c', code],
        env=os.environ | {'PYTHONPATH': str(ROOT / 'tests')},
        stdout=subprocess.PIPE,
        text=True,
    )
    name = kernel.stdout.readline().strip()
    process = psutil.Process(kernel.pid)
    assert wait_until(process.children)
    (build,) = process.children()
    kernel.kill()
    kernel.communicate()
    build.suspend()
    assert module._claim(name).name != name
    build.resume()
    build.wait(timeout=20)
    assert module._claim(name).name == name


def test_a_checkout_with_spaces_and_accents(other, monkeypatch, tmp_path):
    checkout = tmp_path / 'élève one'
    checkout.mkdir()
    monkeypatch.setattr(module, 'ROOT', checkout)
    workspace = Workspace('test_accents')
    assert re.fullmatch(r'[A-Za-z0-9_./-]+', str(workspace.path))
    assert list(checkout.iterdir()) == []
    write_talker(workspace)
    assert workspace.build().ok
    with workspace.run('talker_pkg', 'talker') as talker:
        talker.wait_for('Publishing')
    module._empty(workspace.path)


@pytest.mark.parametrize('name', ['', 'two words', '../up', 'a/b', 3])
def test_names_of_workspaces(name):
    with pytest.raises(ValueError, match='A workspace is named with letters'):
        Workspace(name)


@pytest.mark.parametrize('path', ['/etc/passwd', '../up', 'src/../../up', ''])
def test_a_file_stays_in_its_workspace(other, path):
    with pytest.raises(ValueError, match='Give a path inside the workspace'):
        other.write(path, 'text')


def test_the_tree_of_what_was_installed(built, capsys):
    hidden = ('*.zsh', '*.ps1', '*.dsv', '*.sh', '*.bash', '*.egg-info', 'hook')
    built.print_tree('install/talker_pkg', hide=hidden)
    assert capsys.readouterr().out == (
        'install/talker_pkg/\n'
        '  lib/\n'
        '    python3/site-packages/talker_pkg/\n'
        '      __init__.py\n'
        '      talker.py\n'
        '    talker_pkg/\n'
        '      talker\n'
        '  share/\n'
        '    ament_index/resource_index/packages/\n'
        '      talker_pkg\n'
        '    colcon-core/packages/\n'
        '      talker_pkg\n'
        '    talker_pkg/\n'
        '      package.xml\n'
    )
    with pytest.raises(ValueError, match='There is no folder'):
        built.print_tree('nowhere')


# --- In a notebook -------------------------------------------------------------------------------


@pytest.fixture
def shell():
    from IPython.core.interactiveshell import InteractiveShell

    yield InteractiveShell.instance()
    InteractiveShell.clear_instance()


def test_a_cell_writes_a_file(shell, built, capsys):
    module._register_in_ipython()
    shell.run_cell('%%write src/new_pkg/msg/Empty text.msg\n# é\nint32 a\n')
    assert capsys.readouterr().out == 'Wrote src/new_pkg/msg/Empty text.msg\n'
    assert built.file('src/new_pkg/msg/Empty text.msg').read_text() == '# é\nint32 a\n'
    shell.run_cell('%%write ../up\ntext\n')
    assert 'Give a path inside the workspace' in capsys.readouterr().err
    module.shutil.rmtree(built.path / 'src/new_pkg')


def test_an_interrupted_cell_ends_the_processes(shell, built):
    module._register_in_ipython()
    talker = built.run('talker_pkg', 'talker')
    talker.wait_for('Publishing')
    shell.run_cell('1 + 1')
    assert talker.running
    shell.run_cell('raise KeyboardInterrupt')
    assert not talker.running
