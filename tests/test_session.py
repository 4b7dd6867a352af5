"""A session spins what it is given, and leaves nothing, however its cell ends."""

import contextlib
import gc
import linecache
import signal
import sys
import threading
import time
import warnings
from collections import Counter

import pytest
import rclpy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rclpy.action import ActionClient, ActionServer
from rclpy.exceptions import InvalidHandle, InvalidNodeNameException
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger
from support.nodes import LIMIT_S, Answerer, Asker, Gate, Listener, Talker, spin
from support.processes import run_python, traces
from support.waits import wait_for
from test_msgs.action import Fibonacci

import helpers.ros.session
from helpers.notebook import interrupts
from helpers.ros import domain, private, rosout
from helpers.ros.domain import configure_discovery, reserve_domain_id
from helpers.ros.session import current_session, ros_session

EXECUTORS = pytest.mark.parametrize('threads', [1, 3], ids=['single', 'multi'])


def destroyed(node):
    try:
        with node.handle:
            return False
    except InvalidHandle:
        return True


def talk(messages=1, threads=1):
    """Do what the cell of a lesson does: sessions work in this process."""
    with ros_session() as session:
        talker, listener = Talker(messages), Listener()
        spin(session, talker, listener, threads=threads)
        session.wait_until(lambda: listener.heard, LIMIT_S)
    assert listener.heard[0] == 'Hello World: 0'


@contextlib.contextmanager
def nothing_left():
    """Check that the block leaves no context, no session, no thread and no shared memory."""
    before = traces()
    yield
    assert not rclpy.ok()
    with pytest.raises(RuntimeError, match='No session is open'):
        current_session()
    wait_for(lambda: traces() <= before)  # a thread's last steps come after its join


@pytest.fixture(scope='module', autouse=True)
def started_once():
    """What a process starts only once has been started."""
    talk()


@pytest.fixture(autouse=True)
def nothing_left_behind():
    with nothing_left():
        yield


# Opening


def test_a_session_opens_once():
    with ros_session() as session, pytest.raises(RuntimeError, match='A session opens once'):
        session.__enter__()
    with pytest.raises(RuntimeError, match='A session opens once'), session:
        pass


def test_bare_init_of_the_notebook_is_replaced():
    configure_discovery('LOCALHOST')
    rclpy.init(domain_id=reserve_domain_id())
    talk()


# Spinning


def test_spin_in_the_wrong_place():
    with ros_session() as session:
        executor = spin(session)
        with pytest.raises(ValueError, match='This executor spins already'):
            session.spin(executor)
        with pytest.raises(TypeError, match='session.spin needs an executor, for example'):
            session.spin(SingleThreadedExecutor)
        with pytest.raises(ValueError, match='This executor does not spin'):
            session.wait_until_quiet(SingleThreadedExecutor())
    with pytest.raises(RuntimeError, match='This session is not open'):
        session.spin(executor)
    with ros_session() as session, pytest.raises(ValueError, match='belongs to another session'):
        session.spin(executor)


# Leaving


@EXECUTORS
@pytest.mark.parametrize('body_fails', [False, True])
def test_nothing_is_left(threads, body_fails):
    before = traces()
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
        assert traces() > before
        if body_fails:
            raise KeyError('a mistake in the cell')
    assert not context.ok()
    assert [destroyed(node) for node in (talker, listener, never_added)] == [True] * 3
    talk()


@EXECUTORS
def test_session_that_was_never_closed(threads):
    forgotten = ros_session().__enter__()
    context, talker = rclpy.get_default_context(), Talker(10**6)
    spin(forgotten, talker, threads=threads)
    talk()
    assert destroyed(talker)
    assert not context.ok()
    forgotten.__exit__(None, None, None)  # has nothing to do


def test_session_that_is_open_when_python_ends():
    """Also if a callback never ends. Only what the cell prints is printed; no home is needed."""
    unset = ('ROS_HOME', 'ROS_LOG_DIR', 'RCUTILS_LOGGING_USE_STDOUT')
    said = run_python(
        """
        import threading
        from support.nodes import Listener, Talker, spin
        from helpers.ros import session as module
        module.CLOSE_TIMEOUT_S = 0.2
        session = module.ros_session().__enter__()
        talker = Talker(10**6, period_s=0.001)
        held = Listener(lambda message: threading.Event().wait())
        spin(session, talker, threads=3)
        spin(session, held)
        session.wait_until(lambda: held.heard)
        talker.get_logger().info('printed by the cell')
        session.print_log()
        talker.get_logger().warning('printed by nobody')
        """,
        **dict.fromkeys(unset),
        HOME='/proc/nobody',
    )
    assert said == '[INFO] [minimal_publisher]: printed by the cell\n'


@EXECUTORS
def test_callback_that_does_not_end(threads, monkeypatch):
    monkeypatch.setattr('helpers.ros.session.CLOSE_TIMEOUT_S', 0.3)
    gate = Gate()
    with (
        pytest.raises(RuntimeError, match=r'1 callback\(s\) did not end within 0\.3 s'),
        ros_session() as session,
    ):
        context, listener, talker = rclpy.get_default_context(), Listener(gate), Talker(1)
        spin(session, talker)
        spin(session, listener, threads=threads)
        session.wait_until(lambda: gate.inside == 1, LIMIT_S)
    assert not context.ok()
    assert destroyed(talker)
    talk()
    gate.open()


@pytest.mark.parametrize(
    ('threads', 'timeout_s'),
    [(1, LIMIT_S), (3, None), (1, 0.05), (3, 0.05)],  # at once, or again and again
)
def test_callback_that_waits_for_an_interrupted_cell(threads, timeout_s):
    gate, waiting, ended = threading.Event(), [], []

    def callback(message):
        waiting.append(message)
        while not gate.wait(timeout_s):
            pass
        ended.append(message)

    with pytest.raises(KeyboardInterrupt) as interrupt, ros_session() as session:
        spin(session, Listener(callback), threads=threads)
        spin(session, Talker(1))
        session.wait_until(lambda: waiting, LIMIT_S)
        raise KeyboardInterrupt
    assert ended == waiting
    assert not hasattr(interrupt.value, '__notes__')


# Deadlocks


def ask(threads, style, groups):
    """Let an asker call an answerer until nothing happens any more.

    Return the asker's answer, and whether a thread was free.
    """
    with ros_session() as session:
        asker = Asker(style, groups)
        executor = spin(session, asker, Answerer(), threads=threads)
        session.wait_until(lambda: asker.asked, LIMIT_S)
        free = session.wait_until_quiet(executor)
    return asker.answer, free


@pytest.mark.parametrize(
    ('threads', 'style', 'groups', 'found'),
    [
        (1, 'call', 1, (None, False)),
        (2, 'call', 1, (None, True)),
        (2, 'call', 2, ('clear', True)),
        (2, 'call_twice', 1, (None, True)),
        (1, 'wait', 1, (None, True)),
        (1, 'wait', 2, ('clear', True)),
        (1, 'call_back', 1, ('clear', True)),
    ],
)
def test_deadlock_ends_with_the_session(threads, style, groups, found):
    gc.collect()  # what other tests have left
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter('always')
        assert ask(threads, style, groups) == found
        gc.collect()
    assert warned == []


# Failures


def failing_callback(message=None):
    raise ZeroDivisionError('in the callback')


@EXECUTORS
@pytest.mark.parametrize('while_it_closes', [False, True])
def test_callback_failure_is_raised_at_the_end(threads, while_it_closes):
    # One message, then nothing: a MultiThreadedExecutor alone would never raise.
    begun = threading.Event()

    def callback(message):
        begun.set()
        if while_it_closes:
            wait_for(lambda: not publisher_thread.is_alive())
        failing_callback()

    with pytest.raises(ZeroDivisionError) as failure, ros_session() as session:
        talker, listener = Talker(1), Listener(callback)
        spin(session, talker)
        (publisher_thread,) = (t for t in threading.enumerate() if t.name == 'spin 1')
        spin(session, listener, threads=threads)
        assert begun.wait(LIMIT_S)
    assert failure.traceback[-1].name == 'failing_callback'
    assert destroyed(talker)


@EXECUTORS
@pytest.mark.parametrize('wait', ['wait_until', 'wait_until_quiet'])
def test_waiting_ends_with_a_callback_failure(threads, wait):
    started = time.monotonic()
    with pytest.raises(ZeroDivisionError) as failure, ros_session() as session:
        executor = spin(session, Listener(failing_callback), threads=threads)
        spin(session, Talker(1))
        if wait == 'wait_until':
            session.wait_until(lambda: False, timeout_s=LIMIT_S)
        for _ in range(50):  # the message may still be on its way
            session.wait_until_quiet(executor, LIMIT_S)
    assert time.monotonic() - started < LIMIT_S
    assert failure.traceback[-1].name == 'failing_callback'
    assert not hasattr(failure.value, '__notes__')


@EXECUTORS
def test_failure_of_the_body_comes_first(threads):
    with pytest.raises(KeyError) as failure, ros_session() as session:
        listener = Listener(failing_callback)
        spin(session, listener, threads=threads)
        spin(session, Talker(1))
        wait_for(lambda: listener.heard)
        raise KeyError('a mistake in the cell')
    assert failure.value.__notes__ == [
        "While the session closed: ZeroDivisionError('in the callback')"
    ]


class HalfMade(Node):
    def __init__(self):
        self.publisher = self.create_publisher(String, 'topic', 10)  # before super().__init__()


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
    with nothing_left():
        with pytest.raises(error) as failure, ros_session():
            complete = Node('complete')
            make()
        # `failure` keeps the half-made node alive, as the notebook does that shows the traceback.
        assert not hasattr(failure.value, '__notes__')
    assert destroyed(complete)
    talk()


@pytest.mark.parametrize('by_the_cell', [False, True])
def test_actions_leave_nothing(by_the_cell):
    """rclpy keeps what an executor has found ready until it is spun again, or shut down."""
    with nothing_left(), ros_session() as session:
        node, executor = Node('node'), SingleThreadedExecutor()
        server = ActionServer(node, Fibonacci, 'count', lambda goal_handle: Fibonacci.Result())
        client = ActionClient(node, Fibonacci, 'count')
        executor.add_node(node)
        if not by_the_cell:
            session.spin(executor)
        session.wait_until(client.server_is_ready, LIMIT_S)
        goal = client.send_goal_async(Fibonacci.Goal())
        spin_once = (lambda: executor.spin_once(timeout_sec=0)) if by_the_cell else (lambda: None)
        session.wait_until(lambda: spin_once() or goal.done(), LIMIT_S)
    del server  # until here it and the executor are held, as by variables of a notebook


def test_a_lifecycle_node_leaves_nothing():
    """Its state machine would keep the participant until Python collects the node."""
    with nothing_left(), ros_session():
        camera = LifecycleNode('camera')
    del camera  # until here it is held


@pytest.mark.parametrize(
    'make',
    [
        lambda: Node('alone').create_publisher(String, 'topic', 10),
        lambda: Node('alone').create_subscription(String, 'topic', print, 10),
        lambda: Node('alone').create_client(Trigger, 'look'),
        lambda: Node('alone').create_service(Trigger, 'look', print),
    ],
)
def test_a_node_that_nobody_keeps_leaves_nothing(make):
    with nothing_left(), ros_session():
        end = make()
        gc.collect()
    del end  # until here it is held, as by a variable of a notebook


# Interrupts


def test_an_interrupt_is_the_cells_alone():
    with pytest.raises(KeyboardInterrupt), ros_session() as session:
        talker, listener = Talker(10**6), Listener()
        spin(session, talker, listener)
        try:
            session.wait_until(lambda: listener.heard and signal.raise_signal(signal.SIGINT))
        except KeyboardInterrupt:  # the nodes go on
            heard = len(listener.heard)
            session.wait_until(lambda: len(listener.heard) > heard + 20, LIMIT_S)
            raise


# This module, ours, and those of rclpy that a cell calls.
RUN_BY_A_CELL = (
    *(sys.modules[__name__], domain, interrupts, private, rosout, helpers.ros.session),
    *(rclpy, rclpy.context, rclpy.executors, rclpy.node, threading),
)


def run_cell(before_line):
    """Run the cell. Before each line call `before_line(frame, place)`.

    A place is a file, a function, a line, and which time it is reached.
    """
    files, times = {module.__file__ for module in RUN_BY_A_CELL}, Counter()

    def trace(frame, event, _):
        code = frame.f_code
        if code.co_filename not in files:
            return None
        if event == 'line':
            line = code.co_filename, code.co_name, frame.f_lineno
            # Not at the end of a `with`, which has the same line: Python does not interrupt there.
            begins = next(start for start, _, number in code.co_lines() if number == line[-1])
            if frame.f_lasti == begins:
                times[line] += 1
                before_line(frame, (*line, times[line]))
        return trace

    sys.settrace(trace)
    try:
        talk(10**6, threads=2)
    finally:
        sys.settrace(None)


@pytest.fixture(scope='module')
def places(started_once):
    """Return the places of possible interrupts, each line at most three times."""
    found = []
    run_cell(lambda _, place: found.append(place))
    return [place for place in found if place[-1] <= 3 and not is_pythons_gap(*place)]


def is_pythons_gap(file, function, line, _):
    """Return whether Python's own Condition has given its lock away here, and cannot take it back.

    An Interrupt there becomes 'release unlocked lock': github.com/python/cpython/issues/78667.
    """
    source = linecache.getline(file, line).strip()
    return file == threading.__file__ and (
        function == '_acquire_restore'
        or (
            function == 'wait' and source in ('gotit = False', 'self._acquire_restore(saved_state)')
        )
    )


@pytest.mark.filterwarnings('ignore:Exception ignored in')  # rclpy's own, of a half-made executor
@settings(max_examples=settings.default.max_examples // 8)
@given(data=st.data())
def test_interrupt_anywhere(places, data):
    place = data.draw(st.sampled_from(places))
    reached, before = [], traces()

    def interrupt(_, here):
        if here == place:
            reached.append(here)
            signal.raise_signal(signal.SIGINT)

    # As the notebook does that shows the traceback, `interrupted` keeps what its frames hold.
    with pytest.raises(KeyboardInterrupt) as interrupted:
        run_cell(interrupt)
        assume(reached)  # a wait may have fewer rounds
    assert not hasattr(interrupted.value, '__notes__')
    # Between the lines of a `with` statement no code can clean up: the next session does.
    if place[1] not in ('__enter__', '__exit__'):
        assert not rclpy.ok()
        wait_for(lambda: traces() <= before)
    talk()
    wait_for(lambda: traces() <= before)


@pytest.mark.parametrize('function', ['_initialise', 'start', '_clean_up'])
def test_interrupts_cut_no_critical_part(function):
    """A session that opens, a thread that starts, a session that closes."""
    interrupted = []

    def interrupt(frame, place):
        caller = frame
        while caller is not None and caller.f_code.co_name != function:
            caller = caller.f_back
        if caller is not None:
            interrupted.append(place)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as failure:
        run_cell(interrupt)
    assert len(interrupted) > 5
    assert not hasattr(failure.value, '__notes__')


# The log


def test_warnings_are_printed_at_the_end(capsys):
    with ros_session() as session:
        node, other = Node('node'), Node('a_node')
        logger = node.get_logger()
        logger.info('an info')
        logger.warning('printed by the cell')
        session.print_log()
        logger.info('another info')
        logger.debug('not shown by default')
        logger.warning('a warning')
        logger.fatal('the end')
        other.get_logger().error('an error')
        assert capsys.readouterr().out == (
            '[INFO] [node]: an info\n[WARN] [node]: printed by the cell\n'
        )
    assert capsys.readouterr() == (
        '[ERROR] [a_node]: an error\n[WARN] [node]: a warning\n[FATAL] [node]: the end\n',
        '',
    )


@pytest.mark.parametrize('timer', [False, True])
def test_interrupt_ends_a_spin_of_the_cell_itself(timer):
    """Without a timer, the wait of rcl has no end of its own."""
    with pytest.raises(KeyboardInterrupt), ros_session():
        node = Node('spun')
        if timer:
            node.create_timer(0.1, int)
        threading.Timer(0.3, signal.raise_signal, [signal.SIGINT]).start()
        rclpy.spin(node)
