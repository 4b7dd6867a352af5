"""`ros2 launch` does what the real command does with the same files."""

import contextlib
import re
import select
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from domain_coordinator import domain_id
from support.waits import LIMIT_S, START_LIMIT_S, wait_for

from helpers.ros2.main import main

DATA = Path(__file__).parent / 'data' / 'ros2_launch'
COMMAND = 'import sys; from helpers.ros2.main import main; sys.exit(main())'
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


@contextlib.contextmanager
def launched(*arguments):
    """Run the command beside the block, without a terminal."""
    process = subprocess.Popen(
        [sys.executable, '-c', COMMAND, 'launch', *map(str, arguments)],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def output_of(*arguments):
    """Run the command to its end, and return what it printed."""
    with launched(*arguments) as process:
        out, _ = process.communicate(timeout=START_LIMIT_S)
    assert process.returncode == 0, out
    return out


def read_until(process, *texts):
    """Read what is printed until all of these texts were there."""
    lines = []
    while not all(any(text in line for line in lines) for text in texts):
        assert select.select([process.stdout], [], [], START_LIMIT_S)[0], lines
        lines.append(process.stdout.readline())
        assert lines[-1], lines
    return ''.join(lines)


def printed(out, name):
    """What a process printed, without its name."""
    return [line.removeprefix(f'[{name}] ') for line in out.splitlines() if f'[{name}] ' in line]


def said(out):
    """The messages of `log`."""
    return re.findall(r'\[launch.user\]: (.*)', out)


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
  <set_parameter name="use_sim_time" value="true"/>
  <node pkg="demo_nodes" exec="show" name="me" output="screen" namespace="here"
        args="--x 'a b' $(var who)" ros_args="--log-level debug">
    <param name="text" value="hello"/>
    <param name="whole" value="3"/>
    <param name="given" value="$(var who)"/>
    <param name="as_text" value="$(var who)" type="str"/>
    <param name="list" value="[1.0, 2.5]"/>
    <param name="nested"><param name="deep"><param name="on" value="true"/></param></param>
    <param from="$(dirname)/some.yaml" allow_substs="true"/>
    <remap from="scan" to="laser_$(var who)"/>
  </node>
  <group>
    <push_ros_namespace namespace="house"/>
    <push-ros-namespace namespace="room"/>
    <node pkg="demo_nodes" exec="show" output="screen" namespace="bed"/>
    <node pkg="demo_nodes" exec="show" output="screen" namespace="/garden"/>
  </group>
  <node pkg="demo_nodes" exec="show" output="screen" exec_name="shown"/>
</launch>"""
YAML = """launch:
- arg: {name: who, default: '5'}
- set_parameter: {name: use_sim_time, value: 'true'}
- node:
    pkg: demo_nodes
    exec: show
    name: me
    output: screen
    namespace: here
    args: --x 'a b' $(var who)
    ros_args: --log-level debug
    param:
    - {name: text, value: hello}
    - {name: whole, value: 3}
    - {name: given, value: $(var who)}
    - {name: as_text, value: $(var who), type: str}
    - {name: list, value: [1.0, 2.5]}
    - {name: nested, param: [{name: deep, param: [{name: 'on', value: true}]}]}
    - {from: $(dirname)/some.yaml, allow_substs: true}
    remap:
    - {from: scan, to: laser_$(var who)}
- group:
  - push_ros_namespace: {namespace: house}
  - push-ros-namespace: {namespace: room}
  - node: {pkg: demo_nodes, exec: show, output: screen, namespace: bed}
  - node: {pkg: demo_nodes, exec: show, output: screen, namespace: /garden}
- node: {pkg: demo_nodes, exec: show, output: screen, exec_name: shown}
"""
SIM = ['-p', 'use_sim_time:=True']


@pytest.mark.parametrize(('suffix', 'text'), [('xml', XML), ('yaml', YAML)])
def test_nodes_get_the_arguments_of_the_real_command(suffix, text, prefix, tmp_path):
    file = tmp_path / f'a.launch.{suffix}'
    file.write_text(text)
    (tmp_path / 'some.yaml').write_text('/**: {ros__parameters: {from_file: $(var who)}}')
    parameters = [
        {'text': 'hello'}, {'whole': 3}, {'given': 5}, {'as_text': '5'}, {'list': [1.0, 2.5]},
        {'nested.deep.on': True},
    ]  # fmt: skip
    files = [{'/here/me': {'ros__parameters': parameter}} for parameter in parameters]
    files.append({'/**': {'ros__parameters': {'from_file': 5}}})
    out = output_of(file)
    assert printed(out, 'show-1') == [
        str(
            ['--x', 'a b', '5', '--ros-args', '--log-level', 'debug', '--ros-args']
            + ['-r', '__node:=me', '-r', '__ns:=/here', *SIM]
            + [word for content in files for word in ('--params-file', content)]
            + ['-r', 'scan:=laser_5']
        )
    ]
    assert printed(out, 'show-2') == [str(['--ros-args', '-r', '__ns:=/house/room/bed', *SIM])]
    assert printed(out, 'show-3') == [str(['--ros-args', '-r', '__ns:=/garden', *SIM])]
    assert printed(out, 'shown-4') == [str(['--ros-args', *SIM])]


def test_substitutions_and_conditions(prefix, tmp_path, monkeypatch):
    monkeypatch.setenv('COLOUR', 'blue')
    expected = {
        'a $(var n)b $(env COLOUR) $(env NO_SUCH none)': 'a 3b blue none',
        r'\$(var n)': '$(var n)',
        '$(find-pkg-share demo_nodes) $(find-pkg-prefix demo_nodes)':
            f'{prefix}/share/demo_nodes {prefix}',
        '$(dirname) $(filename)': f'{tmp_path} {tmp_path}/a.launch.xml',
        "$(eval '$(var n) * 2 >= 6 and not 0 == 1')": 'True',
        '$(eval "\'$(env COLOUR)\' in [\'red\', \'green\']")': 'False',
        "$(eval '1 &lt; $(var n) &lt; 3')": 'False',
        "$(if $(equals $(var n) 3.0) 'it is $(var n)' other)": 'it is 3',
        '$(and true $(not 0)) $(or false 0) $(not-equals a b)': 'true false true',
        '$(command "echo a b")': 'a b',
    }  # fmt: skip
    lines = [f'<log message="{text.replace(chr(34), "&quot;")}"/>' for text in expected]
    lines += [
        f'<log message="kept" {condition}/>'
        for condition in (
            'if="$(eval \'$(var n) == 3\')"', 'if=" TRUE "', 'unless="0"'
        )
    ]  # fmt: skip
    lines += [f'<log message="never" {condition}/>' for condition in ('if="0"', 'unless="1"')]
    file = tmp_path / 'a.launch.xml'
    file.write_text(f'<launch><let name="n" value="3"/>{"".join(lines)}</launch>')
    assert said(output_of(file)) == [*(text for text in expected.values()), *['kept'] * 3]


def test_scopes_of_groups_and_of_included_files(prefix, tmp_path):
    (tmp_path / 'inner.launch.yaml').write_text("""launch:
- arg: {name: who, default: inner}
- let: {name: left, value: behind}
- log: {message: inner $(var who) $(filename)}
""")
    file = tmp_path / 'outer.launch.xml'
    file.write_text("""<launch>
  <arg name="mode" default="a"><choice value="a"/><choice value="b"/></arg>
  <set_env name="LEVEL" value="out"/>
  <group><let name="mode" value="in group"/><set_env name="LEVEL" value="in"/>
    <executable cmd="printenv LEVEL" output="screen"/></group>
  <group scoped="false"><let name="open" value="yes"/></group>
  <group forwarding="false"><keep name="kept" value="$(var mode)"/>
    <log message="$(var kept) $(var open none) $(env LEVEL none)"/></group>
  <executable cmd="printenv LEVEL" output="screen"/>
  <include file="$(dirname)/inner.launch.yaml"><arg name="who" value="told $(var mode)"/></include>
  <log message="$(var mode) $(var open) $(var left) $(filename)"/>
  <unset_env name="LEVEL"/>
  <executable cmd="echo [$LEVEL]" shell="true" output="screen" name="shell">
    <env name="OTHER" value="x"/></executable>
  <timer period="0.01"><log message="later"/></timer>
</launch>""")
    out = output_of(file, 'mode:=b')
    assert said(out) == [
        'b none none', f'inner told b {tmp_path}/inner.launch.yaml', f'b yes behind {file}', 'later'
    ]  # fmt: skip
    assert printed(out, 'printenv-1') == ['in']
    assert printed(out, 'printenv-2') == ['out']
    assert printed(out, 'shell-3') == ['[]']


def test_respawn_and_what_all_ends_with(prefix, tmp_path):
    file = tmp_path / 'a.launch.xml'
    file.write_text("""<launch>
  <executable cmd="false" respawn="true" respawn_delay="0.01" respawn_max_retries="2"/>
  <executable cmd="no_such_program_here"/>
</launch>""")
    out = output_of(file)
    assert out.count('process has died') == 3
    assert '[ERROR] [no_such_program_here-2]: exception occurred while executing process: ' in out
    file.write_text("""<launch>
  <executable cmd="sleep 1000" name="long"/>
  <executable cmd="true" on_exit="shutdown"/>
</launch>""")
    out = output_of(file)
    assert '[INFO] [launch]: process[true-2] was required: shutting down launched system' in out
    assert 'exit code -2' in out


STUBBORN = """<launch>
  <executable cmd="{} -c 'import signal as s, time; [s.signal(n, s.SIG_IGN) for n in (2, 15)]; \
print(9, flush=True); time.sleep(1000)'" name="one" output="screen"
    sigterm_timeout="0.1" sigkill_timeout="0.1"/>
</launch>"""


def test_a_process_that_ignores_signals(prefix, tmp_path):
    file = tmp_path / 'a.launch.xml'
    file.write_text(STUBBORN.format(sys.executable))
    with launched(file) as process:
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
  <executable cmd="sleep 1000 &amp; sleep 1000" shell="true" name="two"/>
  <node pkg="demo_nodes" exec="talker" output="screen"><param name="who" value="x"/></node>
</launch>""")
    with launched(file) as process:
        read_until(process, 'ready')
        started = psutil.Process(process.pid).children(recursive=True)
        assert len(started) >= 6
        process.send_signal(number)
        gone, alive = psutil.wait_procs(started, timeout=LIMIT_S)
    left = [p for p in alive if p.status() != psutil.STATUS_ZOMBIE]
    assert not left
    wait_for(lambda: not list((tmp_path / 'tmp').iterdir()))


@pytest.mark.parametrize(
    ('text', 'line', 'sentence'),
    [
        ('<launch>\n <nod/></launch>', 2, "<launch> has no 'nod'"),
        ('<launch>\n <let name="a" value="b" vaule="c"/></launch>', 2, "no attribute 'vaule'"),
        ('<launch>\n\n <let name="a"/></launch>', 3, "needs the attribute 'value'"),
        ('<launch>\n <arg name="a"/></launch>', 2, "argument 'a' is missing: give it as a:=VALUE"),
        ('<launch>\n <arg name="a" default="x"><choice value="y"/></arg></launch>', 2, 'not valid'),
        ('<launch>\n <log message="$(var a)"/></launch>', 2, "'a' does not exist"),
        ('<launch>\n <log message="$(vra a)"/></launch>', 2, 'there is no $(vra)'),
        ('<launch>\n <log message="$(var a"/></launch>', 2, 'not closed'),
        ('<launch>\n <log message="$(eval \'open(1)\')"/></launch>', 2, 'open(1)'),
        ('<launch>\n <log message="x" if="maybe"/></launch>', 2, 'neither true nor false'),
        (
            '<launch>\n <node pkg="demo_nodes" exec="nope"/></launch>',
            2,
            "executable 'nope' not fou",
        ),
        ('<launch>\n <node exec="a" name="b c"/></launch>', 2, "'b c' is no name of a node"),
        ('<launch>\n <node exec="a">\n <param value="1"/></node></launch>', 3, "'param' needs"),
        ('<launch>\n <include file="/nope.xml"/></launch>', 2, "'/nope.xml' is not there"),
        ('<launch>\n <let name="a"\n</launch>', 3, 'no valid XML'),
        ('launch:\n- nod: {}', 2, "'launch' has no 'nod'"),
        ('launch:\n- let:\n    name: a\n    value: 2', 2, "'value' of 'let' must be \"2\""),
        ('launch:\n- log: {message: [}', 2, 'no valid YAML'),
        ('launch:\n- log', 2, 'an action is one key'),
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


def test_a_file_without_arguments(tmp_path, capsys):
    file = tmp_path / 'a.launch.yaml'
    file.write_text('launch: []')
    assert main(['launch', '-s', str(file)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == '  No arguments.'


def test_a_python_launch_file(tmp_path, capsys):
    file = tmp_path / 'a.launch.py'
    file.write_text('LaunchDescription([DeclareLaunchArgument("a"), Node(package="b")])')
    assert main(['launch', str(file)]) == 1
    assert 'Node is <node>, DeclareLaunchArgument is <arg>' in capsys.readouterr().err
