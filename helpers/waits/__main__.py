r"""Say what waits in a program: `python3 -m waits node.py`, then Ctrl+\ in its terminal.

Ctrl+\ is the signal QUIT; `kill -QUIT PID` sends it from another terminal. The program goes on, and
what waits is printed on its stderr. `ros2 run --prefix 'python3 -m waits' PACKAGE PROGRAM` does the
same for a program of a package. `python3 -m helpers.waits --kernel` asks the kernel of a notebook
whose cell hangs.

Why a signal, and not py-spy? Tried on a call in a callback: `py-spy dump --locals` shows each line,
and `entity: <Timer at 0x7ff7>`, but no name of a service, no group, no executor's nodes, and it
cannot ask the graph. Only code inside of the process can. For a process that was started without
this, py-spy is the next best; to let gdb begin a thread in it ended the process.
"""

from __future__ import annotations

import os
import runpy
import signal
import socket
import sys
import threading
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent


def answer_signals(say: Callable[[], None]) -> None:
    """Let this process `say` what waits when the signal QUIT comes, in a thread of its own.

    A handler in Python would have to wait until the main thread is back from C, and the wait of rcl
    does not come back. The byte that Python writes for each signal comes at once.
    """
    reader, writer = socket.socketpair()
    writer.setblocking(False)

    def watch(_keep: socket.socket = writer) -> None:
        while number := reader.recv(1):
            if number[0] == signal.SIGQUIT:
                say()

    signal.signal(signal.SIGQUIT, lambda *_: None)
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=watch, name='waits', daemon=True).start()


def what_to_say() -> Callable[[], None]:
    """Return a function that prints what waits. It imports nothing more.

    Two threads that import parts of one package at the same time can end with an error, and one of
    them would be the program: so rclpy is here before the program begins.
    """
    try:  # a folder that runs as a program has no package around it
        from helpers.waits import NOTHING, explain
    except ImportError:
        from waits import NOTHING, explain
    return lambda: print(explain() or NOTHING, file=sys.stderr, flush=True)


def main(arguments: list[str]) -> None:
    """Run a program as Python does, and answer signals meanwhile."""
    if arguments[:1] == ['--kernel'] and len(arguments) <= 2:
        from helpers.waits.kernels import ask_kernel

        print(ask_kernel(*arguments[1:]))
        return
    if not arguments or arguments[0].startswith('-'):
        sys.exit('Use: python3 -m waits PROGRAM [ARGUMENTS ...]')
    if Path(arguments[0]).name.startswith('python') and len(arguments) > 1:
        arguments = arguments[1:]  # `ros2 run --prefix` may name the interpreter, too
    try:
        compile(Path(arguments[0]).read_bytes(), arguments[0], 'exec')
    except (OSError, SyntaxError, ValueError) as error:
        sys.exit(f'{arguments[0]} is no program in Python: {error}')
    sys.path.append(str(HERE.parent))
    answer_signals(what_to_say())
    print(f'Ctrl+\\ or `kill -QUIT {os.getpid()}` says what waits.', file=sys.stderr, flush=True)
    sys.argv = arguments
    sys.path[0] = str(Path(arguments[0]).resolve().parent)
    runpy.run_path(arguments[0], run_name='__main__')


if __name__ == '__main__':
    main(sys.argv[1:])
