"""An Interrupt waits for the end of what must not be cut in two."""

import signal
import threading

import pytest
from support.kernel import Kernel

from helpers.notebook.interrupts import uninterrupted


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
