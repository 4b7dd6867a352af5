"""`ros2 launch` does what the real command does with the same files."""

import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import psutil
import pytest
from domain_coordinator import domain_id
from processes import ros2
from waits import LIMIT_S, START_LIMIT_S, wait_for

from ros2_command.main import main

DATA = Path(__file__).parent / 'launch'
# Prints its arguments, and the content of the files among them.
SHOW = """
import sys, yaml
seen = [yaml.safe_load(open(a)) if 'launch_params_' in a else a for a in sys.argv[1:]]
print(seen, flush=True)
"""


@pytest.fixture(scope='module')
def sections():
    """What the real command printed, by its arguments, masked."""
    parts = (DATA / 'launch.txt').read_text().split('=== ros2 launch ')[1:]
    return {part.partition('\n')[0]: masked(part.partition('\n')[2]) for part in parts}


def masked(text, workspace='WORKSPACE'):
    text = text.replace(str(workspace), 'WORKSPACE')
    for pattern, mask in (
        (r'below \S+', 'below LOGS'),
        (r'pid \[?\d+', 'pid [N'),
        (r'\[\d+\.\d+\]', '[TIME]'),
        (r'\S+launch_params_\S+', 'FILE'),
        (r'exit \d+\n', ''),
        # There a second SIGINT came, of the program that interrupted it.
        (r"\[ERROR\] \[talker-1\]: process has died \[pid \[N, exit code -2, cmd '.*'\]\.",
         '[INFO] [talker-1]: process has finished cleanly [pid [N]'),
    ):  # fmt: skip
        text = re.sub(pattern, mask, text)
    return text


@pytest.fixture
def prefix(tmp_path, monkeypatch):
    """An installed package `demo_nodes`, and an environment in which it is found."""
    prefix = tmp_path / 'install' / 'demo_nodes'
    share, programs = prefix / 'share' / 'demo_nodes', prefix / 'lib' / 'demo_nodes'
    index = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages'
    for folder in (share / 'launch', programs, index, tmp_path / 'tmp'):
        folder.mkdir(parents=True)
    (index / 'demo_nodes').touch()
    for file in DATA.glob('talk.launch.*'):
        (share / 'launch' / file.name).write_text(file.read_text())
    scripts = {name: (DATA / name).read_text() for name in ('talker', 'listener')}
    for name, text in {**scripts, 'show': SHOW}.items():
        (programs / name).write_text(f'#!{sys.executable}\n{text}')
        (programs / name).chmod(0o755)
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'log'))
    monkeypatch.setenv('TALKER_SPINS', str(tmp_path / 'spins'))
    monkeypatch.setenv('TMPDIR', str(tmp_path / 'tmp'))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with domain_id() as domain:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        yield prefix


def launched(*arguments):
    """Run the command beside the block, without a terminal."""
    return ros2('launch', *arguments, stderr=subprocess.STDOUT)


@pytest.fixture
def output_of(prefix, tmp_path):
    """Return a function that launches a text to its end, and returns what each process printed."""

    def output_of(text, *arguments):
        file = tmp_path / f'a.launch.{"xml" if text.startswith("<") else "yaml"}'
        file.write_text(text)
        with launched(file, *arguments) as process:
            out, _ = process.communicate(timeout=START_LIMIT_S)
        assert process.returncode == 0, out
        lines = {}
        for name, line in re.findall(r'(?m)^\[(\w+-\d+)\] (.*)', out):
            lines.setdefault(name, []).append(line)
        return lines, out

    return output_of


def read_until(process, *texts):
    """Read what is printed until all of these texts were there."""
    lines, limit = [], threading.Timer(START_LIMIT_S, process.kill)
    limit.start()
    while not all(any(text in line for line in lines) for text in texts):
        lines.append(process.stdout.readline())
        assert lines[-1], lines
    limit.cancel()
    return ''.join(lines)


@pytest.mark.parametrize(
    ('arguments', 'ends'),
    [
        ('demo_nodes talk.launch.xml', ['ready', 'exit code 3']),
        ('demo_nodes talk.launch.xml who:=Ada quiet:=true', ['ready']),
        ('demo_nodes talk.launch.yaml who:=Bob', ['ready']),
    ],
)
def test_prints_what_the_real_command_prints(arguments, ends, prefix, sections, tmp_path):
    with launched(*arguments.split()) as process:
        out = read_until(process, *ends)
        wait_for((tmp_path / 'spins').exists)
        process.send_signal(signal.SIGINT)
        out += process.communicate(timeout=LIMIT_S)[0]
    # The lines of several processes have no order among them.
    assert sorted(masked(out, tmp_path).splitlines()) == sorted(sections[arguments].splitlines())
    assert process.returncode == 0
    assert not list((tmp_path / 'tmp').iterdir())
    log = next((tmp_path / 'log').glob('2*')) / 'launch.log'
    assert 'process started with pid' in log.read_text()


@pytest.mark.parametrize(
    'arguments',
    ['-s demo_nodes talk.launch.xml', 'demo_nodes nothing.launch.xml', 'nothing talk.launch.xml'],
)
def test_says_what_the_real_command_says(arguments, prefix, sections, capsys, tmp_path):
    status = main(['launch', *arguments.split()])
    out, err = capsys.readouterr()
    searched = re.sub(r"'[^']*'\]", "'ENVIRONMENT']", err)
    assert masked(out + searched, tmp_path) == sections[arguments]
    assert status == (0 if arguments.startswith('-s') else 1)


XML = """<launch>
  <arg name="who" default="5"/>
  <node pkg="demo_nodes" exec="show" name="me" output="screen" namespace="here"
        args="--x 'a b' $(var who)">
    <param name="text" value="hello"/>
    <param name="whole" value="3"/>
    <param name="given" value="$(var who)"/>
    <param name="list" value="[1.0, 2.5]"/>
    <param from="$(dirname)/some.yaml"/>
    <remap from="scan" to="laser_$(var who)"/>
  </node>
  <group>
    <push_ros_namespace namespace="house"/>
    <push-ros-namespace namespace="room"/>
    <node pkg="demo_nodes" exec="show" output="screen" namespace="bed"/>
    <node pkg="demo_nodes" exec="show" output="screen" namespace="/garden"/>
  </group>
  <node pkg="demo_nodes" exec="show" output="screen"/>
</launch>"""
YAML = """launch:
- arg: {name: who, default: '5'}
- node:
    pkg: demo_nodes
    exec: show
    name: me
    output: screen
    namespace: here
    args: --x 'a b' $(var who)
    param:
    - {name: text, value: hello}
    - {name: whole, value: 3}
    - {name: given, value: $(var who)}
    - {name: list, value: [1.0, 2.5]}
    - {from: $(dirname)/some.yaml}
    remap:
    - {from: scan, to: laser_$(var who)}
- group:
  - push_ros_namespace: {namespace: house}
  - push-ros-namespace: {namespace: room}
  - node: {pkg: demo_nodes, exec: show, output: screen, namespace: bed}
  - node: {pkg: demo_nodes, exec: show, output: screen, namespace: /garden}
- node: {pkg: demo_nodes, exec: show, output: screen}
"""


@pytest.mark.parametrize('text', [XML, YAML], ids=['xml', 'yaml'])
def test_nodes_get_the_arguments_of_the_real_command(text, output_of, tmp_path):
    (tmp_path / 'some.yaml').touch()
    parameters = [{'text': 'hello'}, {'whole': 3}, {'given': 5}, {'list': [1.0, 2.5]}]
    files = [{'/here/me': {'ros__parameters': parameter}} for parameter in parameters]
    files.append(f'{tmp_path}/some.yaml')
    lines, _ = output_of(text)
    words = ['--x', 'a b', '5', '--ros-args', '-r', '__node:=me', '-r', '__ns:=/here']
    words += [word for content in files for word in ('--params-file', content)]
    assert lines == {
        'show-1': [str([*words, '-r', 'scan:=laser_5'])],
        'show-2': [str(['--ros-args', '-r', '__ns:=/house/room/bed'])],
        'show-3': [str(['--ros-args', '-r', '__ns:=/garden'])],
        'show-4': [str(['--ros-args'])],
    }


def test_substitutions_and_conditions(output_of, prefix, tmp_path, monkeypatch):
    monkeypatch.setenv('COLOUR', 'blue')
    expected = {
        'a $(var n)b $(env COLOUR) $(env NO_SUCH none)': 'a 3b blue none',
        r'\$(var n)': '$(var n)',
        '$(find-pkg-share demo_nodes) $(dirname)': f'{prefix}/share/demo_nodes {tmp_path}',
        "$(eval '$(var n) * 2 >= 6 and not 0 == 1')": 'True',
        "$(eval \"'$(env COLOUR)' in ['red', 'green']\")": 'False',
        "$(eval '1 < $(var n) < 3')": 'False',
        '$(eval \'0 or "a" * 2\')': 'aa',
        "$(eval '[1, 2.5] + [-7 // 2, 2 ** 0.5 > 1]')": '[1, 2.5, -4, True]',
        "$(eval 'None is not None and 1 / 0')": 'False',
        "$(command 'echo -n $(var n)  4')": '3 4',
    }
    actions = [
        {'let': {'name': 'n', 'value': '3'}},
        *({'executable': {'cmd': f'echo {text}'}} for text in expected),
    ]
    for condition in ("$(eval '$(var n) == 3')", ' TRUE ', '0'):
        actions.append({'executable': {'cmd': 'echo if', 'if': condition}})
        actions.append({'executable': {'cmd': 'echo unless', 'unless': condition}})
    lines, _ = output_of(json.dumps({'launch': actions}), '-a')
    assert [line for _, [line] in sorted(lines.items(), key=number)] == [
        *expected.values(), 'if', 'if', 'unless'
    ]  # fmt: skip


def number(item):
    return int(item[0].rpartition('-')[2])


def test_scopes_of_groups_and_of_included_files(output_of, tmp_path):
    (tmp_path / 'inner.launch.yaml').write_text("""launch:
- arg: {name: who, default: inner}
- let: {name: left, value: behind}
- executable: {cmd: echo $(var who) $(dirname), output: screen}
""")
    text = """<launch>
  <arg name="mode" default="a"/>
  <set_env name="LEVEL" value="out"/>
  <group><let name="mode" value="in group"/><set_env name="LEVEL" value="in"/>
    <executable cmd="printenv LEVEL" output="screen"/></group>
  <executable cmd="printenv LEVEL OTHER" output="screen"><env name="OTHER" value="x"/></executable>
  <include file="$(dirname)/inner.launch.yaml"><arg name="who" value="told $(var mode)"/></include>
  <executable cmd="echo $(var mode) $(var left)" output="screen"/>
</launch>"""
    lines, _ = output_of(text, 'mode:=b')
    assert lines == {
        'printenv-1': ['in'],
        'printenv-2': ['out', 'x'],
        'echo-3': [f'told b {tmp_path}'],
        'echo-4': ['b behind'],
    }


def test_respawn_and_what_all_ends_with(output_of):
    _, out = output_of("""<launch>
  <executable cmd="false" respawn="true" respawn_delay="0.01" respawn_max_retries="2"/>
  <executable cmd="no_such_program_here"/>
</launch>""")
    assert out.count('process has died') == 3
    assert '[ERROR] [no_such_program_here-2]: exception occurred while executing process: ' in out
    _, out = output_of("""<launch>
  <executable cmd="sleep 1000" name="long"/>
  <executable cmd="true" on_exit="shutdown"/>
</launch>""")
    assert '[INFO] [launch]: process[true-2] was required: shutting down launched system' in out
    assert 'exit code -2' in out


STUBBORN = """<launch>
  <executable cmd="{} -c 'import signal as s, time; [s.signal(n, s.SIG_IGN) for n in (2, 15)]; \
print(9, flush=True); time.sleep(1000)'" name="one" output="screen"/>
</launch>"""


def test_a_process_that_ignores_signals(prefix, tmp_path):
    file = tmp_path / 'a.launch.xml'
    file.write_text(STUBBORN.format(sys.executable))
    with launched(file, 'sigterm_timeout:=0.1', 'sigkill_timeout:=0.1') as process:
        read_until(process, '[one-1] 9')
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=LIMIT_S)
    assert re.sub(r'pid \d+|, cmd.*', '', out).splitlines() == [
        '[WARNING] [launch]: user interrupted with ctrl-c (SIGINT)',
        "[INFO] [one-1]: sending signal 'SIGINT' to process[one-1]",
        "[ERROR] [one-1]: process[one-1] failed to terminate '0.1' seconds after receiving "
        "'SIGINT', escalating to 'SIGTERM'",
        "[INFO] [one-1]: sending signal 'SIGTERM' to process[one-1]",
        "[ERROR] [one-1]: process[one-1] failed to terminate '0.2' seconds after receiving "
        "'SIGTERM', escalating to 'SIGKILL'",
        "[INFO] [one-1]: sending signal 'SIGKILL' to process[one-1]",
        '[ERROR] [one-1]: process has died [, exit code -9',
    ]


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_nothing_outlives_the_launcher(number, prefix, tmp_path):
    file = tmp_path / 'a.launch.xml'
    file.write_text("""<launch>
  <executable cmd="sleep 1000"/>
  <executable cmd="sh -c 'sleep 1000 &amp; sleep 1000'" name="two"/>
  <node pkg="demo_nodes" exec="talker" output="screen"><param name="who" value="x"/></node>
</launch>""")
    with launched(file) as process:
        read_until(process, 'ready')
        started = psutil.Process(process.pid).children(recursive=True)
        assert len(started) >= 6
        process.send_signal(number)
        _, alive = psutil.wait_procs(started, timeout=LIMIT_S)
    assert not [p for p in alive if p.is_running() and p.status() != psutil.STATUS_ZOMBIE]
    wait_for(lambda: not list((tmp_path / 'tmp').iterdir()))


PARAM = '<param name="a" value="1" type="bool"/>'
EVAL = '<let name="b" value="$(eval \'{}\')"/>'


@pytest.mark.parametrize(
    ('text', 'line', 'sentence'),
    [
        ('<launch>\n <nod/></launch>', 2, "<launch> has no 'nod'"),
        ('<launch>\n <let name="a" value="b" vaule="c"/></launch>', 2, "no attribute 'vaule'"),
        ('<launch>\n\n <let name="a"/></launch>', 3, "needs the attribute 'value'"),
        ('<launch>\n <arg name="a"/></launch>', 2, "argument 'a' is missing: give it as a:=VALUE"),
        ('<launch>\n <let name="b" value="$(var a)"/></launch>', 2, "'a' does not exist"),
        ('<launch>\n <let name="b" value="$(vra a)"/></launch>', 2, 'there is no $(vra)'),
        ('<launch>\n <let name="b" value="$(var a"/></launch>', 2, 'not closed'),
        ('<launch>\n <let name="b" value="$(eval \'open(1)\')"/></launch>', 2, 'open(1)'),
        (f'<launch>\n {EVAL.format("9**9**9**9")}</launch>', 2, 'a power has at most 10000 bits'),
        (f'<launch>\n {EVAL.format("1 &lt;&lt; 9**9")}</launch>', 2, 'by at most 10000 bits'),
        (f'<launch>\n {EVAL.format("9**9 * [0]")}</launch>', 2, 'at most 100000 characters'),
        (f'<launch>\n {EVAL.format("1 / 0")}</launch>', 2, 'has no value: division by zero'),
        ('<launch>\n <let name="a" value="$(command \'ls /no\')"/></launch>', 2, 'No such file'),
        ('<launch>\n <let name="a" value="$(command \'/no\')"/></launch>', 2, 'be executed'),
        (f'<launch>\n <node exec="a">\n {PARAM}</node></launch>', 3, "'bool' is not a type"),
        ('<launch>\n <executable cmd=""/></launch>', 2, 'there is no command'),
        ('<launch>\n <executable cmd="a" output="no"/></launch>', 2, "no output is called 'no'"),
        ('<launch>\n <node exec="a" if="maybe"/></launch>', 2, 'neither true nor false'),
        ('<launch>\n <node pkg="demo_nodes" exec="no"/></launch>', 2, "executable 'no' not found"),
        ('<launch>\n <node exec="a">\n <param value="1"/></node></launch>', 3, "'param' needs"),
        ('<launch>\n <include file="/nope.xml"/></launch>', 2, "'/nope.xml' is not there"),
        ('<launch>\n <let name="a"\n</launch>', 3, 'no valid XML'),
        ('launch:\n- nod: {}', 2, "'launch' has no 'nod'"),
        ('launch:\n- let:\n    name: a\n    value: 2', 2, "'value' of 'let' must be \"2\""),
        ('launch:\n- let: {name: [}', 2, 'no valid YAML'),
        ('launch:\n- let', 2, 'an action is one key'),
    ],
)
def test_a_mistake_is_one_sentence_with_its_line(text, line, sentence, prefix, tmp_path, capsys):
    file = tmp_path / f'a.launch.{"xml" if text.startswith("<") else "yaml"}'
    file.write_text(text)
    assert main(['launch', str(file)]) == 1
    out, err = capsys.readouterr()
    assert err.startswith(f'{file}:{line}: ')
    assert sentence in err
    assert (out, err.count('\n')) == ('', 1)


def test_a_python_launch_file(tmp_path, capsys):
    file = tmp_path / 'a.launch.py'
    file.write_text('LaunchDescription([DeclareLaunchArgument("a"), Node(package="b")])')
    assert main(['launch', str(file)]) == 1
    assert 'Node is <node>, DeclareLaunchArgument is <arg>' in capsys.readouterr().err
