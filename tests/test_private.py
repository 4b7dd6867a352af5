"""The private names of other packages that helpers touch are all listed, and all still there."""

import ast
import inspect
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, thread
from pathlib import Path
from types import SimpleNamespace

import _quickjs
import pexpect
import pytest
import rclpy
from ipykernel.comm.comm import BaseComm
from ipykernel.kernelbase import Kernel
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

import helpers
from helpers.private_names import PRIVATE_NAMES

HELPERS = Path(helpers.__file__).parent
PRIVATE = re.compile(r'_[a-zA-Z]\w*')
# Documented by Python and IPython; and texts that only look like names.
NO_SECRETS = {
    *('_asdict', '_config', '_exit_code', '_fields', '_pose_rejection_threshold', '_session_log'),
}


@pytest.fixture(scope='module')
def owners():
    """One of each kind of thing that has private names."""
    context = rclpy.Context()
    context.init(domain_id=101)
    executor = MultiThreadedExecutor(2, context=context)
    node = rclpy.create_node('node', context=context)
    yield {
        'an executor': executor,
        'a MultiThreadedExecutor': executor,
        'a client': node.create_client(Trigger, 'look'),
        'a lifecycle node': LifecycleNode('lifecycle', context=context),
        'an action client': ActionClient(node, Fibonacci, 'patrol'),
        'a ThreadPoolExecutor': ThreadPoolExecutor(),
        'sys': sys,
        'a kernel': Kernel,
        'a comm': BaseComm,
        'a process of pexpect': pexpect.spawn,
        'quickjs-ng': SimpleNamespace(_quickjs=_quickjs),
    }
    node.destroy_node()
    executor.shutdown()
    context.shutdown()


def modules():
    """Yield each module of helpers: its file, and what is in it."""
    for file in sorted(HELPERS.rglob('*.py')):
        path = file.relative_to(HELPERS)
        if path.parts[0] != 'private_names.py':
            yield path, list(ast.walk(ast.parse(file.read_text())))


def used(things):
    """Return the private names that a module uses, also those in texts, as for getattr."""
    names = set()
    # The end of an f-string, `f'{part}_covariance'`, is no name.
    ends = {
        id(part) for text in things if isinstance(text, ast.JoinedStr) for part in text.values[1:]
    }
    for thing in things:
        match thing:
            case ast.Constant() if id(thing) in ends:
                continue
            case ast.Attribute(attr=name) | ast.Constant(value=str(name)):
                names.add(name)
            case ast.ImportFrom(module=module, names=imported) if not module.startswith('helpers.'):
                names.update(module.split('.'), (alias.name for alias in imported))
            case ast.Import(names=imported):
                names.update(part for alias in imported for part in alias.name.split('.'))
    return set(filter(PRIVATE.fullmatch, names))


def defined(things):
    """Return the names that a module gives to things of its own."""
    names = set()
    for thing in things:
        match thing:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name):
                names.add(name)
            case ast.Name(id=name, ctx=ast.Store()):
                names.add(name)
            case ast.Attribute(attr=name, value=ast.Name(id='self'), ctx=ast.Store()):
                names.add(name)
    return names


@pytest.mark.parametrize('entry', PRIVATE_NAMES, ids=lambda entry: entry.name)
def test_a_name_is_still_there(owners, entry):
    owner = owners[entry.owner]
    # A class of which an instance gets the name later.
    later = inspect.isclass(owner) and f'self.{entry.name} = ' in inspect.getsource(owner)
    assert later or hasattr(owner, entry.name), (
        f'{entry.owner} has no {entry.name} any more, as it had in {entry.version}.'
    )


def test_the_list_is_true():
    listed = {(entry.file, entry.name) for entry in PRIVATE_NAMES}
    names = {(str(path), name) for path, things in modules() for name in used(things)}
    own = {(path.parts[0], name) for path, things in modules() for name in defined(things)}
    foreign = {
        (file, name)
        for file, name in names
        if (Path(file).parts[0], name) not in own and name not in NO_SECRETS
    }
    assert foreign <= listed, 'These are not in helpers/private_names.py.'
    assert listed <= names, 'These are in helpers/private_names.py, and nobody uses them.'


def test_where_a_thread_waits_can_be_seen():
    assert {'self', 'timeout'} <= set(inspect.signature(threading.Event.wait).parameters)
    assert 'work_queue.get(block=True)' in inspect.getsource(thread), (
        'An idle thread of a pool no longer waits in concurrent.futures.thread.'
    )
