"""An Interrupt waits for the end of what must not be cut in two."""

import importlib
import inspect
import os
import signal
import sys
import threading

import pytest
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
from support.kernel import Kernel

from helpers.notebook import interrupts
from helpers.notebook.interrupts import PatientInterrupt, uninterrupted
from helpers.ros import ros_session


def test_an_interrupt_waits_for_the_end():
    done, handler = [], signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        signal.raise_signal(signal.SIGINT)
        done.append(1)
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is handler


def test_an_interrupt_survives_a_failing_block():
    with pytest.raises(KeyboardInterrupt) as interrupt, uninterrupted():
        signal.raise_signal(signal.SIGINT)
        raise ZeroDivisionError
    assert isinstance(interrupt.value.__context__, ZeroDivisionError)


def test_a_command_of_a_cell_can_be_interrupted_and_knows_its_variables():
    with Kernel() as kernel:
        kernel.run('import helpers.ros.session')
        interrupt = threading.Timer(2, kernel.km.provisioner.process.send_signal, [signal.SIGINT])
        interrupt.start()
        said = kernel.run('!sleep 60\nprint("the cell goes on")')
        assert 'the cell goes on' not in said
        assert kernel.run('!echo the kernel lives').strip() == 'the kernel lives'
        in_a_function = 'def say(word):\n    !echo {word} $word\n\nsay("twice")'
        assert kernel.run(in_a_function).strip() == 'twice twice'


def test_an_import_that_ends_its_cell_leaves_no_interrupt_to_the_next(tmp_path):
    (tmp_path / 'a_library.py').write_text(PRESS)
    with Kernel() as kernel:
        kernel.run(
            'import sys\n'
            'from helpers.notebook import interrupts\n'
            'interrupts.is_students = lambda file: False\n'
            f'sys.path.insert(0, {str(tmp_path)!r})\n'
        )
        kernel.run('import a_library')
        # For longer than the time after which an Interrupt comes again.
        assert kernel.run('a_library.time.sleep(0.5)\nprint("its end")') == 'its end\n'


PRESS = 'import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\n'
LONG = 'time.sleep(60)\n'


@pytest.mark.parametrize(
    ('name', 'source', 'is_whole'),
    [
        ('a_library', f'{PRESS}whole = True\n', True),
        ('a_library_that_hangs', f'{PRESS}{PRESS}{LONG}', False),
        ('my_module', f'{PRESS}{LONG}', False),
    ],
)
def test_an_interrupt_comes_after_an_import(name, source, is_whole, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / f'{name}.py').write_text(source)
    monkeypatch.setattr(interrupts, 'is_students', lambda file: file.endswith('my_module.py'))
    before = signal.signal(signal.SIGINT, PatientInterrupt(signal.default_int_handler))
    try:
        with pytest.raises(KeyboardInterrupt):
            importlib.import_module(name)
            threading.Event().wait(60)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (name in sys.modules) == is_whole


PRESSES = """
def __init__(self, **fields):
    os.kill(os.getpid(), signal.SIGINT)
    original(self, **fields)
"""


def test_an_interrupt_comes_after_a_message_is_taken(monkeypatch):
    names = {'original': String.__init__, 'os': os, 'signal': signal}
    exec(compile(PRESSES, inspect.getfile(String), 'exec'), names)
    heard = []
    with ros_session():
        node = Node('node')
        node.create_subscription(String, 'topic', lambda message: heard.append(message.data), 1)
        publisher = node.create_publisher(String, 'topic', 1)
        message = String(data='whole')
        monkeypatch.setattr(String, '__init__', names['__init__'])
        before = signal.signal(signal.SIGINT, PatientInterrupt(signal.default_int_handler))
        try:
            with pytest.raises(KeyboardInterrupt):
                publisher.publish(message)
                while True:
                    rclpy.spin_once(node, timeout_sec=0.1)
        finally:
            signal.signal(signal.SIGINT, before)
            node.destroy_node()
    assert heard == ['whole']
