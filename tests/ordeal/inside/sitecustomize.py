"""Python imports this at the start of each program of an ordeal, because it is on its path.

It notes each callback and each thread of the program in a file, and lets one raise when a file
with its name appears. The program's own code is not changed.
"""

import ctypes
import functools
import importlib.abc
import importlib.util
import inspect
import os
import sys
import threading
import time
from pathlib import Path

FOLDER = Path(os.environ['ORDEAL_FOLDER']) if 'ORDEAL_FOLDER' in os.environ else None
LOOK_S = 0.02


class OrdealError(RuntimeError):
    """What a callback or a thread raises when the ordeal lets it."""


def note(name):
    with (FOLDER / 'callbacks').open('a') as file:
        file.write(f'{name}\n')


def is_armed(name):
    return (FOLDER / f'raise {name}').exists()


def of_program(function):
    module = getattr(function, '__module__', None) or ''
    return not module.startswith(('rclpy', 'helpers', 'launch', 'ros2'))


def raising(callback, owner, fallback):
    """Return a callback that raises when it is armed. `owner` is the name of its node."""
    if not callable(callback) or not of_program(callback):
        return callback
    called = getattr(callback, '__name__', '') or fallback
    name = f'{owner}.{fallback if called == "<lambda>" else called}'
    note(name)

    def look():
        if is_armed(name):
            raise OrdealError(f'The ordeal raises in {name}.')

    if inspect.iscoroutinefunction(callback):

        @functools.wraps(callback)
        async def wrapped(*arguments, **options):
            look()
            return await callback(*arguments, **options)
    else:

        @functools.wraps(callback)
        def wrapped(*arguments, **options):
            look()
            return callback(*arguments, **options)

    return wrapped


def change(owner, method, position, word, fallback):
    """Let a method of rclpy take a callback that may raise: its argument of a position or word."""
    original = getattr(owner, method)

    @functools.wraps(original)
    def changed(self, *arguments, **options):
        node = arguments[0] if method == '__init__' else self
        given = [*arguments]
        if word in options:
            options[word] = raising(options[word], node.get_name(), fallback)
        elif position < len(given):
            given[position] = raising(given[position], node.get_name(), fallback)
        return original(self, *given, **options)

    setattr(owner, method, changed)


def change_node(module):
    node = module.Node
    change(node, 'create_subscription', 2, 'callback', 'subscription')
    change(node, 'create_timer', 1, 'callback', 'timer')
    change(node, 'create_service', 2, 'callback', 'service')


def change_action_server(module):
    server = module.ActionServer
    change(server, '__init__', 3, 'execute_callback', 'execute')
    for word in ('goal_callback', 'handle_accepted_callback', 'cancel_callback'):
        change(server, '__init__', 99, word, word)


CHANGES = {'rclpy.node': change_node, 'rclpy.action.server': change_action_server}


class Finder(importlib.abc.MetaPathFinder):
    """Changes a module of rclpy right after its import."""

    def find_spec(self, name, path, target=None):
        if name not in CHANGES:
            return None
        sys.meta_path.remove(self)
        try:
            spec = importlib.util.find_spec(name)
        finally:
            sys.meta_path.insert(0, self)
        load = spec.loader.exec_module

        def exec_module(module):
            load(module)
            CHANGES[name](module)

        spec.loader.exec_module = exec_module
        return spec


def watch_threads():
    """Raise in a thread of the program when it is armed."""
    start = threading.Thread.start

    def started(thread):
        target = getattr(thread, '_target', None)
        start(thread)
        if target is None or target is watch or not of_program(target):
            return
        if target.__module__.split('.')[0] in sys.stdlib_module_names:
            return
        name = f'thread.{target.__name__}'
        note(name)
        threading.Thread(target=watch, args=(thread, name), daemon=True).start()

    def watch(thread, name):
        while thread.is_alive():
            if is_armed(name):
                ctypes.pythonapi.PyThreadState_SetAsyncExc(
                    ctypes.c_ulong(thread.ident), ctypes.py_object(OrdealError)
                )
                return
            time.sleep(LOOK_S)

    threading.Thread.start = started


if FOLDER is not None:
    sys.meta_path.insert(0, Finder())
    watch_threads()
