import contextlib
import fcntl
import gc
import os
import random
import signal
import subprocess
import sys
import textwrap
import threading
import time
import traceback
import warnings

import pytest
import rclpy
from domain_coordinator import domain_id as reserved_domain_id
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle, InvalidNodeNameException
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
from support.nodes import LIMIT_S, Answerer, Asker, Gate, Listener, Talker, spin
from support.processes import kill

from helpers import session as module
from helpers.session import (
    configure_discovery,
    current_session,
    graph_environment,
    reserve_domain_id,
    ros_session,
)
from tools.soak.leftovers import left_in_process, state_of_process

EXECUTORS = pytest.mark.parametrize('threads', [1, 3], ids=['single', 'multi'])


def start_python(script, **environment):
    """Start a Python process. A variable whose value is None is removed from its environment."""
    here = os.path.dirname(__file__)
    variables = {**os.environ, 'PYTHONPATH': here, **environment}
    return subprocess.Popen(
        [sys.executable, '-c', textwrap.dedent(script)],
        env={name: value for name, value in variables.items() if value is not None},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@contextlib.contextmanager
def running(*arguments, **environment):
    process = start_python(*arguments, **environment)
    try:
        yield process
    finally:
        kill(process)
        process.communicate()


def run_python(script, **environment):
    """Run a script that must succeed without a word on stderr, and return its stdout."""
    with running(script, **environment) as process:
        out, err = process.communicate(timeout=3 * LIMIT_S)
    assert (process.returncode, err) == (0, '')
    return out


def wait_for(predicate):
    limit = time.monotonic() + LIMIT_S
    pause = threading.Event()
    while not predicate():
        assert time.monotonic() < limit
        pause.wait(0.01)


def python_threads():
    return set(threading.enumerate())


def os_threads():
    return len(os.listdir('/proc/self/task'))


def destroyed(node):
    try:
        with node.handle:
            return False
    except InvalidHandle:
        return True


def talk():
    """Open a session in which one message arrives: sessions work in this process."""
    with ros_session() as session:
        talker, listener = Talker(1), Listener()
        spin(session, talker, listener)
        session.wait_until(lambda: listener.heard, LIMIT_S)
    assert listener.heard == ['Hello World: 0']


@pytest.fixture(autouse=True)
def nothing_left_behind():
    """Every test here must leave no session, no context and no thread."""
    before = python_threads()
    yield
    assert module._open_session is None
    assert not rclpy.ok()
    assert python_threads() <= before


# Opening


def test_domain_of_its_own():
    domains = []
    for _ in range(2):
        with ros_session():
            domains.append(rclpy.get_default_context().get_domain_id())
    assert domains == [reserve_domain_id()] * 2
    assert 1 <= domains[0] <= 100
    elsewhere = run_python("""
        import rclpy
        from helpers.session import ros_session
        with ros_session():
            print(rclpy.get_default_context().get_domain_id())
    """)
    assert 1 <= int(elsewhere) <= 100
    assert int(elsewhere) != domains[0]


def test_no_domain_left():
    # The real reservation, in a range of ports that no other process of this machine needs.
    said = run_python("""
        import contextlib, socket
        import domain_coordinator.impl
        domain_coordinator.impl.PORT_BASE = 21000
        sockets = [socket.socket() for _ in range(100)]
        for number, taken in enumerate(sockets, 1):
            with contextlib.suppress(OSError):
                taken.bind(('', 21000 + number))
        from helpers.session import ros_session
        try:
            ros_session().open()
        except RuntimeError as error:
            print(error)
        sockets[41].close()
        with ros_session():
            print('open')
    """)
    assert said.splitlines() == [
        'All 100 ROS domain ids of this machine are in use: '
        'shut down the kernels that you no longer need, then run this cell again.',
        'open',
    ]


def test_discovery_stays_on_this_machine(monkeypatch):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    monkeypatch.setenv('ROS_LOCALHOST_ONLY', '0')
    monkeypatch.setenv('ROS_STATIC_PEERS', '192.0.2.1')
    with ros_session():
        assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
        assert not {'ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS'} & os.environ.keys()
    configure_discovery()  # also where nothing is to be removed


def test_processes_do_not_hear_each_other():
    other = """
        import sys, rclpy
        from helpers.session import configure_discovery, ros_session
        from rclpy.node import Node
        from std_msgs.msg import String
        name, domain = {name!r}, {domain}
        session = ros_session().open() if domain is None else None
        if session is None:
            configure_discovery()
            rclpy.init(domain_id=domain)
        node = Node(name)
        publisher = node.create_publisher(String, 'topic', 10)
        node.create_timer(0.02, lambda: publisher.publish(String(data=name)))
        print('talking', flush=True)
        rclpy.spin(node)
    """
    with ros_session() as session:
        listener = Listener()
        spin(session, listener)
        domain = rclpy.get_default_context().get_domain_id()
        with running(other.format(name='stranger', domain=None)) as stranger:
            assert stranger.stdout.readline() == 'talking\n'
            # The guest, who talks in our domain, is heard although it began later.
            with running(other.format(name='guest', domain=domain)):
                session.wait_until(lambda: len(listener.heard) >= 25, LIMIT_S)
            assert stranger.poll() is None
        assert set(listener.heard) == {'guest'}


@pytest.fixture
def shared_id():
    """Return a domain id that nobody on this machine has reserved."""
    with reserved_domain_id(lambda: random.randint(30, 100)) as free:
        pass
    return free


def is_free(domain):
    with contextlib.suppress(RuntimeError), reserved_domain_id(lambda: domain):
        return True
    return False


def test_domain_that_two_processes_share(shared_id):
    other = f"""
        from support.nodes import Talker, spin
        from helpers.session import ros_session
        with ros_session(domain_id={shared_id}) as session:
            spin(session, Talker(10**6))
            input()
    """
    with ros_session(domain_id=shared_id) as session:
        assert rclpy.get_default_context().get_domain_id() == shared_id
        assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
        listener = Listener()
        spin(session, listener)
        with running(other):
            session.wait_until(lambda: listener.heard, LIMIT_S)
        assert not is_free(shared_id)  # no kernel that wants to be alone comes into this domain
    assert is_free(shared_id)


def test_domain_of_somebody_else(shared_id):
    with reserved_domain_id(lambda: shared_id):
        with pytest.raises(
            ValueError, match=f'Domain {shared_id} is reserved on this machine: agr'
        ):
            ros_session(domain_id=shared_id).open()
        assert not rclpy.ok()
    with ros_session(domain_id=shared_id):
        pass


def test_discovery_in_the_network(shared_id, monkeypatch):
    monkeypatch.setenv('ROS_LOCALHOST_ONLY', '1')
    monkeypatch.setenv('ROS_STATIC_PEERS', '192.0.2.1')
    with ros_session(domain_id=shared_id, discovery='SUBNET'):
        assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'
        assert os.environ['ROS_STATIC_PEERS'] == '192.0.2.1'
        assert 'ROS_LOCALHOST_ONLY' not in os.environ
        assert graph_environment() == {
            'ROS_DOMAIN_ID': str(shared_id),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
            'ROS_STATIC_PEERS': '192.0.2.1',
        }
    alone = {
        'ROS_DOMAIN_ID': str(reserve_domain_id()),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
    }
    assert graph_environment() == alone
    with ros_session():
        assert graph_environment() == alone
        assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
        assert rclpy.get_default_context().get_domain_id() == reserve_domain_id()


@pytest.mark.parametrize(
    ('arguments', 'error', 'said'),
    [
        ({'domain_id': '42'}, TypeError, "a whole number from 0 to 101, not '42'"),
        ({'domain_id': True}, TypeError, 'a whole number from 0 to 101, not True'),
        ({'domain_id': 102}, ValueError, 'a whole number from 0 to 101, not 102'),
        ({'domain_id': -1}, ValueError, 'a whole number from 0 to 101, not -1'),
        ({'discovery': 'subnet'}, ValueError, "'LOCALHOST' or 'SUBNET', not 'subnet'"),
        ({'discovery': 'SUBNET'}, ValueError, 'needs the domain id that the other machines use'),
    ],
)
def test_bad_domain_or_discovery(arguments, error, said):
    with pytest.raises(error, match=said):
        ros_session(**arguments)


@pytest.fixture
def turn(tmp_path, monkeypatch):
    """Return an open folder. Who locks it has the turn to make or to end a participant."""
    monkeypatch.setattr(module, 'SHARED_MEMORY', str(tmp_path))
    folder = os.open(tmp_path, os.O_RDONLY)
    yield folder
    os.close(folder)


def has(turn):
    """Return whether this lock can be taken. It is given back."""
    try:
        fcntl.flock(turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    fcntl.flock(turn, fcntl.LOCK_UN)
    return True


def test_a_session_waits_for_its_turn_to_make_and_to_end_its_participant(turn, monkeypatch):
    free = set()

    class Noting(Node):
        def __init__(self, *arguments, **options):
            free.add(('made', has(turn)))
            super().__init__(*arguments, **options)

        def destroy_node(self):
            free.add(('ended', has(turn)))
            super().destroy_node()

    monkeypatch.setattr(module, 'Node', Noting)
    with ros_session():
        assert has(turn)
    assert has(turn)
    assert free == {('made', False), ('ended', False)}


def test_a_session_opens_when_the_turn_of_another_process_is_over(turn, monkeypatch):
    lock, refused = fcntl.flock, []

    def flock(folder, operation):
        try:
            lock(folder, operation)
        except BlockingIOError:
            refused.append(folder)
            lock(turn, fcntl.LOCK_UN)
            raise

    lock(turn, fcntl.LOCK_EX)
    monkeypatch.setattr(fcntl, 'flock', flock)
    with ros_session():
        assert len(refused) == 1


@pytest.mark.parametrize('folder', [None, '/proc/no such folder'])
def test_a_session_opens_without_a_turn(turn, folder, monkeypatch):
    fcntl.flock(turn, fcntl.LOCK_EX)  # and whoever has it was stopped
    monkeypatch.setattr(module, 'TURN_TIMEOUT_S', 2 * module.POLL_S)
    if folder is not None:
        monkeypatch.setattr(module, 'SHARED_MEMORY', folder)
    with ros_session():
        assert rclpy.ok()
    assert not rclpy.ok()


def test_open_twice():
    with ros_session() as session, pytest.raises(RuntimeError, match='A session opens once'):
        session.open()
    with pytest.raises(RuntimeError, match='A session opens once'):
        session.open()


def test_current_session():
    with pytest.raises(RuntimeError, match='No session is open'):
        current_session()
    with ros_session() as session:
        assert current_session() is session


def test_bare_init_of_the_notebook_is_replaced():
    configure_discovery()
    rclpy.init(domain_id=reserve_domain_id())
    talk()


def test_no_rclpy():
    said = run_python("""
        import sys
        sys.modules['rclpy'] = None  # as if it were not installed
        try:
            import helpers.session
        except ImportError as error:
            print(error)
    """)
    assert said.startswith('rclpy cannot be imported in this Python')
    assert 'make lab' in said
    assert said.count('\n') == 1


# Spinning


@EXECUTORS
def test_spin(threads):
    with ros_session() as session:
        talker, listener = Talker(5), Listener()
        executor = spin(session, talker, listener, threads=threads)
        assert executor.context is rclpy.get_default_context()
        session.wait_until(lambda: len(listener.heard) == 5, LIMIT_S)
    assert listener.heard == [f'Hello World: {i}' for i in range(5)]


@pytest.mark.parametrize('wrong', ['x', None, SingleThreadedExecutor, 4])
def test_spin_no_executor(wrong):
    with ros_session() as session, pytest.raises(TypeError, match='session.spin needs an executor'):
        session.spin(wrong)


def test_spin_twice():
    with ros_session() as session:
        executor = spin(session)
        with pytest.raises(ValueError, match='This executor spins already'):
            session.spin(executor)


def test_spin_executor_of_another_session():
    with ros_session():
        executor = SingleThreadedExecutor()
    with ros_session() as session, pytest.raises(ValueError, match='belongs to another session'):
        session.spin(executor)


def test_spin_outside():
    session = ros_session()
    with ros_session():
        executor = SingleThreadedExecutor()
        with pytest.raises(RuntimeError, match='This session is not open'):
            session.spin(executor)
    with session:
        executor = SingleThreadedExecutor()
    with pytest.raises(RuntimeError, match='This session is not open'):
        session.spin(executor)


def test_wait_until_gives_up():
    with ros_session() as session:
        started = time.monotonic()
        with pytest.raises(TimeoutError, match=r'Waited 0\.2 s in vain'):
            session.wait_until(lambda: False, timeout_s=0.2)
        assert time.monotonic() - started >= 0.2


# Leaving


@EXECUTORS
@pytest.mark.parametrize('body_fails', [False, True])
def test_nothing_is_left(threads, body_fails):
    talk()  # what a process starts only once has been started
    before, os_before = python_threads(), os_threads()
    with (
        pytest.raises(KeyError) if body_fails else contextlib.nullcontext(),
        ros_session() as session,
    ):
        talker, listener, never_added = Talker(3), Listener(), Node('never_added')
        already_destroyed = Node('already_destroyed')
        already_destroyed.destroy_node()
        context = rclpy.get_default_context()
        spin(session, talker)
        spin(session, listener, threads=threads)
        session.wait_until(lambda: len(listener.heard) == 3, LIMIT_S)
        assert python_threads() > before
        assert os_threads() > os_before
        assert not destroyed(never_added)
        if body_fails:
            raise KeyError('a mistake in the cell')
    assert python_threads() == before
    assert [node for node in (talker, listener, never_added) if not destroyed(node)] == []
    assert not context.ok()
    wait_for(lambda: os_threads() <= os_before)
    talk()


@EXECUTORS
def test_session_that_was_never_closed(threads):
    before = python_threads()
    forgotten = ros_session().open()
    context, talker = rclpy.get_default_context(), Talker(10**6)
    spin(forgotten, talker, threads=threads)
    talk()
    assert destroyed(talker)
    assert not context.ok()
    assert python_threads() == before
    forgotten.close()  # has nothing to do


@EXECUTORS
def test_session_that_is_open_when_python_ends(threads):
    started = time.monotonic()
    said = run_python(f"""
        from support.nodes import Listener, Talker, spin
        from helpers.session import ros_session
        session = ros_session().open()
        talker, listener = Talker(10**6, period_s=0.001), Listener()
        spin(session, talker, listener, threads={threads})
        session.wait_until(lambda: listener.heard)
        talker.get_logger().warning('printed by nobody')
        print('end')
    """)
    assert said == 'end\n'
    assert time.monotonic() - started < LIMIT_S


def test_held_callback_does_not_keep_python_from_ending():
    run_python("""
        import threading
        from support.nodes import Listener, Talker, spin
        from helpers import session as module
        module.CLOSE_TIMEOUT_S = 0.2
        session = module.ros_session().open()
        listener = Listener(lambda message: threading.Event().wait())
        spin(session, Talker(1), listener)
        session.wait_until(lambda: listener.heard)
    """)


@pytest.mark.parametrize('threads', [2, 4])
@pytest.mark.parametrize('default_event_callbacks', [True, False])
def test_saturated_reentrant_group(threads, default_event_callbacks):
    def saturate():
        inside = []

        def callback(message):
            inside.append(message)
            wait_for(lambda: session._executors[0]._executor._shutdown)  # the session closes

        with ros_session() as session:
            listener = Listener(
                callback,
                callback_group=ReentrantCallbackGroup(),
                event_callbacks=SubscriptionEventCallbacks(
                    use_default_callbacks=default_event_callbacks
                ),
            )
            # Published beforehand: such a group takes the CPU away from a talker that spins.
            talker = Talker(20)
            for _ in range(20):
                talker.publish()
            executor = spin(session, listener, threads=threads)
            session.wait_until(lambda: len(inside) == threads, LIMIT_S)
            session.wait_until(lambda: executor._executor._work_queue.qsize(), LIMIT_S)
        assert destroyed(listener)
        assert len(inside) == threads

    gc.collect()  # what other tests have left
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter('always')
        saturate()
        gc.collect()
    # A handler that rclpy had made and that never ran would warn here.
    assert [str(warning.message) for warning in warned] == []


@EXECUTORS
def test_callback_that_does_not_end(threads, monkeypatch):
    monkeypatch.setattr(module, 'CLOSE_TIMEOUT_S', 0.3)
    gate, before = Gate(), python_threads()
    with (
        pytest.raises(RuntimeError, match=r'1 callback\(s\) did not end within 0\.3 s'),
        ros_session() as session,
    ):
        context, listener, talker = rclpy.get_default_context(), Listener(gate), Talker(1)
        spin(session, talker)
        spin(session, listener, threads=threads)
        session.wait_until(lambda: gate.inside == 1, LIMIT_S)
        started = time.monotonic()
    assert time.monotonic() - started >= 0.3
    assert python_threads() > before  # the callback has not ended
    assert not context.ok()
    assert destroyed(talker)
    talk()
    gate.open()
    wait_for(lambda: python_threads() == before)


@EXECUTORS
@pytest.mark.parametrize('timeout_s', [None, LIMIT_S])
def test_callback_that_waits_for_an_interrupted_cell(threads, timeout_s):
    gate, before, waiting, ended = threading.Event(), python_threads(), [], []

    def callback(message):
        waiting.append(message)
        gate.wait(timeout_s)
        ended.append(message)

    with pytest.raises(KeyboardInterrupt) as interrupt, ros_session() as session:
        spin(session, Listener(callback), threads=threads)
        spin(session, Talker(1))
        session.wait_until(lambda: waiting, LIMIT_S)
        raise KeyboardInterrupt
    assert ended == waiting
    assert not hasattr(interrupt.value, '__notes__')
    assert python_threads() == before


@EXECUTORS
def test_interrupt_while_a_thread_starts(threads, monkeypatch):
    start, before = threading.Thread.start, python_threads()

    def interrupted_start(thread):
        signal.raise_signal(signal.SIGINT)
        start(thread)

    with pytest.raises(KeyboardInterrupt) as interrupt, ros_session() as session:
        listener = Listener()
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, 'start', interrupted_start)
            spin(session, listener, threads=threads)
    assert not hasattr(interrupt.value, '__notes__')
    assert destroyed(listener)
    assert python_threads() == before


@EXECUTORS
def test_callback_that_only_takes_long_ends_by_itself(threads):
    gate, pauses = threading.Event(), []

    with pytest.raises(KeyboardInterrupt), ros_session() as session:
        spin(session, Listener(lambda message: pauses.append(gate.wait(0.5))), threads=threads)
        Talker(1).publish()
        session.wait_until_quiet(session._executors[0])
        raise KeyboardInterrupt
    assert pauses == [False]
    assert not gate.is_set()


# Deadlocks


def ask(threads, style='call', groups=1, work=None):
    """Let an asker call an answerer until nothing happens any more. Return the asker's answer."""
    with ros_session() as session:
        asker = Asker(style, groups)
        executor = spin(session, asker, Answerer(work), threads=threads)
        session.wait_until(lambda: asker.asked, LIMIT_S)
        session.wait_until_quiet(executor)
    return asker.answer


@pytest.mark.parametrize(
    ('threads', 'style', 'groups', 'answer'),
    [
        (1, 'call', 1, None),
        (1, 'call', 2, None),
        (2, 'call', 1, None),
        (2, 'call', 2, 'clear'),
        (2, 'call_twice', 1, None),
        (1, 'wait', 1, None),
        (1, 'wait', 2, 'clear'),
        (2, 'wait', 1, None),
        (2, 'wait', 2, 'clear'),
        (1, 'call_back', 1, 'clear'),
    ],
)
def test_deadlock_ends_with_the_session(threads, style, groups, answer):
    gc.collect()  # what other tests have left
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter('always')
        assert ask(threads, style, groups) == answer
        gc.collect()
    assert [str(warning.message) for warning in warned] == []


@pytest.mark.parametrize('style', ['call', 'call_back'])
def test_nobody_answers(style, capsys):
    with ros_session() as session:
        asker = Asker(style)
        executor = spin(session, asker)
        session.wait_until(lambda: asker.asked, LIMIT_S)
        session.wait_until_quiet(executor)
    gc.collect()
    assert asker.answer is None
    assert capsys.readouterr() == ('', '')


def test_work_is_not_quiet():
    assert ask(2, groups=2, work=lambda: time.sleep(0.5)) == 'clear'
    assert ask(1, 'wait', groups=2, work=lambda: time.sleep(0.5)) == 'clear'


def test_work_without_end_is_never_quiet():
    gate = threading.Event()

    def work():
        while not gate.is_set():
            time.sleep(0.001)

    with ros_session() as session:
        asker = Asker('call_back')
        executor = spin(session, asker, Answerer(work), threads=2)
        session.wait_until(lambda: asker.asked, LIMIT_S)
        with pytest.raises(TimeoutError):
            session.wait_until_quiet(executor, timeout_s=0.6)
        gate.set()


def test_quiet_executor_must_spin():
    with ros_session() as session, pytest.raises(ValueError, match='does not spin'):
        session.wait_until_quiet(SingleThreadedExecutor())


@EXECUTORS
def test_interrupt_of_a_deadlock(threads):
    with running(f"""
        import threading
        import rclpy
        from support.nodes import Answerer, Asker, spin
        from helpers.session import ros_session

        try:
            with ros_session() as session:
                asker = Asker()
                executor = spin(session, asker, Answerer(), threads={threads})
                session.wait_until(lambda: asker.asked)
                session.wait_until_quiet(executor)
                print('ready', flush=True)
                session.wait_until(lambda: asker.answer)
        except KeyboardInterrupt:
            print(asker.answer, rclpy.ok(), threading.active_count())
    """) as process:
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, out, err) == (0, 'None False 1\n', '')


# Nodes that are destroyed while their callbacks run


@EXECUTORS
def test_subscriber_destroyed_in_its_callback(threads):
    gate = Gate()
    with ros_session() as session:
        listener, talker = Listener(gate), Talker(5)
        executor = spin(session, listener, threads=threads)
        for _ in range(5):
            talker.publish()
        session.wait_until(lambda: gate.inside == 1, LIMIT_S)
        listener.destroy_node()
        gate.open()
        session.wait_until_quiet(executor)
    assert listener.heard == ['Hello World: 0']


def test_service_destroyed_in_its_callback():
    gate = Gate()
    with pytest.raises(InvalidHandle), ros_session() as session:
        asker, answerer = Asker(groups=2), Answerer(gate)
        spin(session, asker, answerer, threads=3)
        session.wait_until(lambda: gate.inside == 1, LIMIT_S)
        answerer.destroy_node()
        gate.open()
        session.wait_until(lambda: asker.answer, LIMIT_S)


@pytest.mark.parametrize('style', ['call', 'wait'])
def test_client_destroyed_while_it_waits(style):
    gate = Gate()
    with ros_session() as session:
        asker = Asker(style, groups=2)
        executor = spin(session, asker, Answerer(gate), threads=3)
        session.wait_until(lambda: gate.inside == 1, LIMIT_S)
        asker.destroy_node()
        gate.open()
        session.wait_until_quiet(executor)
    assert asker.answer is None


# Failures


def failing_callback(message):
    raise ZeroDivisionError('in the callback')


def frames(failure):
    return [frame.name for frame in traceback.extract_tb(failure.__traceback__)]


@EXECUTORS
def test_callback_failure_is_raised_at_the_end(threads):
    # One message, then nothing: a MultiThreadedExecutor alone would never raise.
    done = threading.Event()

    def callback(message):
        done.set()
        failing_callback(message)

    with pytest.raises(ZeroDivisionError) as failure, ros_session() as session:
        spin(session, Listener(callback), threads=threads)
        talker = Talker(1)
        spin(session, talker)
        assert done.wait(LIMIT_S)
    assert 'failing_callback' in frames(failure.value)
    assert destroyed(talker)
    talk()


@EXECUTORS
def test_callback_failure_while_the_session_closes(threads):
    begun = threading.Event()

    def callback(message):
        begun.set()
        wait_for(lambda: executor._is_shutdown)
        failing_callback(message)

    with pytest.raises(ZeroDivisionError) as failure, ros_session() as session:
        executor = spin(session, Listener(callback), threads=threads)
        spin(session, Talker(1))
        assert begun.wait(LIMIT_S)
    assert 'failing_callback' in frames(failure.value)


@EXECUTORS
def test_first_callback_failure_is_raised(threads):
    def callback(message):
        raise ValueError(message.data)

    with (
        pytest.raises(ValueError, match='^Hello World: 0$'),
        ros_session() as session,
    ):
        talker, listener = Talker(20), Listener(callback, depth=20)
        spin(session, listener, threads=threads)
        spin(session, talker)
        wait_for(lambda: talker.next_number == 20)


@EXECUTORS
def test_wait_until_raises_a_callback_failure_at_once(threads):
    with pytest.raises(ZeroDivisionError) as failure, ros_session() as session:
        spin(session, Listener(failing_callback), threads=threads)
        spin(session, Talker(1))
        started = time.monotonic()
        try:
            session.wait_until(lambda: False, timeout_s=LIMIT_S)
        finally:
            assert time.monotonic() - started < LIMIT_S / 2
    assert 'failing_callback' in frames(failure.value)
    assert not hasattr(failure.value, '__notes__')


@pytest.mark.parametrize('style', ['call', 'wait'])
def test_failure_in_a_service(style):
    with pytest.raises(ZeroDivisionError) as failure, ros_session() as session:
        asker = Asker(style, groups=2)
        spin(session, asker, Answerer(lambda: failing_callback(None)), threads=2)
        session.wait_until(lambda: asker.answer, LIMIT_S)
    assert 'failing_callback' in frames(failure.value)
    assert asker.answer is None


@EXECUTORS
def test_failure_while_waiting_for_quiet(threads):
    with pytest.raises(ZeroDivisionError), ros_session() as session:
        executor = spin(session, Listener(failing_callback), threads=threads)
        spin(session, Talker(1))
        for _ in range(50):  # the message may still be on its way
            session.wait_until_quiet(executor, LIMIT_S)


@EXECUTORS
def test_failure_of_the_body_comes_first(threads):
    done = threading.Event()

    def callback(message):
        done.set()
        failing_callback(message)

    with pytest.raises(KeyError) as failure, ros_session() as session:
        spin(session, Listener(callback), threads=threads)
        spin(session, Talker(1))
        assert done.wait(LIMIT_S)
        raise KeyError('a mistake in the cell')
    assert failure.value.__notes__ == [
        "While the session closed: ZeroDivisionError('in the callback')"
    ]


@EXECUTORS
def test_shutdown_by_the_cell_is_no_failure(threads):
    with ros_session() as session:
        spin(session, Listener(), threads=threads)
        rclpy.shutdown()
        wait_for(lambda: not session._spin_threads[0].is_alive())


class HalfMade(Node):
    def __init__(self):
        self.publisher = self.create_publisher(String, 'topic', 10)  # before super().__init__()


class Undestroyable(Node):
    def destroy_node(self):
        raise ValueError('a mistake in destroy_node')


@pytest.mark.parametrize(
    ('make', 'error'),
    [
        (lambda: Node('not a name'), InvalidNodeNameException),
        (HalfMade, AttributeError),
        (lambda: Node('node', parameter_overrides='wrong'), AttributeError),
    ],
    ids=['bad name', 'no super', 'bad parameters'],
)
@pytest.mark.filterwarnings('ignore:Failed to fini rosout publisher')  # rclpy's own
def test_node_that_could_not_be_made(make, error):
    with pytest.raises(error) as failure, ros_session():
        complete = Node('complete')
        make()
    # `failure` keeps the half-made node alive, as the notebook does that shows the traceback.
    assert not hasattr(failure.value, '__notes__')
    assert destroyed(complete)
    talk()


def test_node_that_cannot_be_destroyed():
    with ros_session():
        nodes = [Node('one'), Undestroyable('two'), Node('three')]
        context = rclpy.get_default_context()
    assert not context.ok()
    assert [destroyed(node) for node in nodes] == [True, True, True]
    talk()


# Interrupts


@pytest.mark.parametrize('wait', ['session.wait_until(lambda: False)', 'threading.Event().wait()'])
def test_interrupt(wait):
    with running(f"""
        import threading
        import rclpy
        from support.nodes import Listener, Talker, spin
        from helpers.session import ros_session

        for turn in ('first', 'second'):
            try:
                with ros_session() as session:
                    talker, listener = Talker(10**6), Listener()
                    spin(session, talker, listener)
                    session.wait_until(lambda: listener.heard)
                    print(turn, 'ready', flush=True)
                    try:
                        {wait}
                    except KeyboardInterrupt:
                        # Nothing but the cell was interrupted: the nodes go on.
                        heard = len(listener.heard)
                        session.wait_until(lambda: len(listener.heard) > heard + 20)
                        raise
            except KeyboardInterrupt:
                print(turn, rclpy.ok(), threading.active_count(), flush=True)
    """) as process:
        for turn in ('first', 'second'):
            assert process.stdout.readline() == f'{turn} ready\n'
            process.send_signal(signal.SIGINT)
            assert process.stdout.readline() == f'{turn} False 1\n'
        out, err = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, out, err) == (0, '', '')


def interrupt_once(monkeypatch, thing, name):
    """Replace a function by one that is interrupted when it is called first."""
    original = getattr(thing, name)

    def interrupted(*arguments, **options):
        monkeypatch.setattr(thing, name, original)
        raise KeyboardInterrupt

    monkeypatch.setattr(thing, name, interrupted)


@pytest.mark.parametrize(
    ('thing', 'name'),
    [
        (threading.Thread, 'join'),
        (MultiThreadedExecutor, 'shutdown'),
        (module.Session, 'log'),
        (Node, 'destroy_node'),
        (rclpy, 'try_shutdown'),
    ],
)
def test_interrupt_of_close(thing, name, monkeypatch):
    before = python_threads()
    with pytest.raises(KeyboardInterrupt), ros_session() as session:
        context, talker, listener = rclpy.get_default_context(), Talker(10**6), Listener()
        spin(session, talker, listener, threads=2)
        session.wait_until(lambda: listener.heard, LIMIT_S)
        interrupt_once(monkeypatch, thing, name)
    assert not context.ok()
    assert destroyed(talker)
    assert destroyed(listener)
    assert python_threads() == before
    talk()


@pytest.mark.parametrize(
    ('thing', 'name'),
    [
        (Node, 'create_publisher'),
        (rclpy.node, 'ROSClock'),
        (rclpy.node, 'TimeSource'),
        (rclpy.node, 'ParameterService'),
        (rclpy.node, 'TypeDescriptionService'),
    ],
)
def test_interrupt_of_a_node_that_is_made(thing, name, monkeypatch):
    before = state_of_process()
    # As the notebook does that shows the traceback, `failure` keeps the half-made node alive.
    with pytest.raises(KeyboardInterrupt) as failure, ros_session():  # noqa: F841
        interrupt_once(monkeypatch, thing, name)
        Node('half_made')
    assert left_in_process(before, state_of_process()) == []
    talk()


def test_interrupt_between_a_publisher_and_its_node(monkeypatch):
    """The frame of create_publisher has the publisher, and the traceback has the frame."""

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    before = state_of_process()
    with pytest.raises(KeyboardInterrupt) as failure, ros_session():  # noqa: F841
        node = Node('node')
        node.create_publisher(String, 'topic', 10, publisher_class=interrupted)
    assert left_in_process(before, state_of_process()) == []
    talk()


@pytest.mark.parametrize(
    ('thing', 'name'),
    [
        (module, 'reserve_domain_id'),
        (rclpy, 'get_default_context'),
        (module, 'Node'),
        (module, 'QoSProfile'),
        (Node, 'get_logger'),
    ],
)
def test_interrupt_of_open(thing, name, monkeypatch):
    before = state_of_process()
    with pytest.raises(KeyboardInterrupt) as failure:  # noqa: F841
        interrupt_once(monkeypatch, thing, name)
        ros_session().open()
    assert left_in_process(before, state_of_process()) == []
    talk()


# The log


def test_log(capsys):
    with ros_session() as session:
        talker, listener = Node('minimal_publisher'), Node('minimal_subscriber')
        for i in range(3):
            talker.get_logger().info(f'Publishing: "{i}"')
        listener.get_logger().info('I heard: "Hello World: 7"')
        session.print_log('minimal_subscriber')
        talker.get_logger().error('late')
        talker.get_logger().debug('not shown by default')
        talker.destroy_node()
        session.print_log('minimal_publisher')
    for _ in range(2):  # a cell that runs again shows the same
        session.print_log('minimal_subscriber')
        session.print_log('minimal_publisher')
    printed = (
        '[INFO] [minimal_subscriber]: I heard: "Hello World: 7"\n'
        '[INFO] [minimal_publisher]: Publishing: "0"\n'
        '[INFO] [minimal_publisher]: Publishing: "1"\n'
        '[INFO] [minimal_publisher]: Publishing: "2"\n'
        '[ERROR] [minimal_publisher]: late\n'
    )
    assert capsys.readouterr() == (3 * printed, '')
    assert [record.text for record in session.log('minimal_publisher')] == [
        'Publishing: "0"',
        'Publishing: "1"',
        'Publishing: "2"',
        'late',
    ]
    assert len(session.log()) == 5


def test_warnings_are_printed_at_the_end(capsys):
    with ros_session() as session:
        node = Node('node')
        logger = node.get_logger()
        logger.info('an info')
        logger.warning('printed by the cell')
        session.print_log()
        logger.info('another info')
        logger.warning('a warning')
        logger.fatal('the end')
        assert capsys.readouterr().out == (
            '[INFO] [node]: an info\n[WARN] [node]: printed by the cell\n'
        )
    assert capsys.readouterr() == ('[WARN] [node]: a warning\n[FATAL] [node]: the end\n', '')


def test_log_keeps_a_long_run():
    # More than the 1000 records that a publisher of /rosout keeps.
    with ros_session() as session:
        node = Node('node')
        logger = node.get_logger()
        for i in range(3000):
            logger.info(str(i))
    assert [record.text for record in session.log('node')] == [str(i) for i in range(3000)]


def test_log_of_a_process(tmp_path):
    """Nothing but what the cell prints arrives at the pipes, and no home is needed."""
    said = run_python(
        """
        from support.nodes import Listener, Talker, spin
        from helpers.session import ros_session
        with ros_session() as session:
            talker = Talker(3)
            listener = Listener(lambda message: talker.get_logger().info(message.data))
            spin(session, talker, listener)
            session.wait_until(lambda: len(listener.heard) == 3)
        session.print_log()
        """,
        HOME='/proc/nobody',
        ROS_HOME=None,
        ROS_LOG_DIR=None,
        RCUTILS_LOGGING_USE_STDOUT=None,
        RCUTILS_COLORIZED_OUTPUT=None,
        RCUTILS_CONSOLE_OUTPUT_FORMAT=None,
    )
    assert said.splitlines() == [f'[INFO] [minimal_publisher]: Hello World: {i}' for i in range(3)]
