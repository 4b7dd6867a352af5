"""Each private name of another package that helpers touch says where it was read, and is there.

A comment on its line, or alone on the line above, says what has the name, and in which version:
`# private: an executor, rclpy 7.1.6`. A new version may take the name away.
"""

import ast
import inspect
import io
import re
import sys
import threading
import tokenize
from concurrent.futures import ThreadPoolExecutor, thread
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import _quickjs
import pexpect
import pytest
import rclpy
from ipykernel.comm.comm import BaseComm
from ipykernel.kernelbase import Kernel
from IPython.core import interactiveshell
from rclpy.action import ActionClient, ActionServer
from rclpy.action.client import ClientGoalHandle
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.task import Future, Task
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

import helpers
from helpers.ros.domain import configure_discovery

HELPERS = Path(helpers.__file__).parent
PRIVATE = re.compile(r'_[a-zA-Z]\w*')
COMMENT = re.compile(r'# private: (?P<owner>.+), (?P<version>\S+ [\d.]+)')
# Documented by Python and IPython; and texts that only look like names.
NO_SECRETS = {
    *(
        '_asdict',
        '_config',
        '_exit',
        '_exit_code',
        '_fields',
        '_pose_rejection_threshold',
        '_session_log',
    ),
}


@pytest.fixture(scope='module')
def owners():
    """One of each kind of thing that has private names."""
    # Fast DDS reads its profiles once in a process: later sessions need those of the course.
    configure_discovery('LOCALHOST')
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
        'an action server': ActionServer(node, Fibonacci, 'patrol', print),
        'a goal handle': ClientGoalHandle,
        'a MutuallyExclusiveCallbackGroup': MutuallyExclusiveCallbackGroup(),
        'a future': Future(),
        'a task': Task(print),
        'a rate': node.create_rate(1),
        'a Condition': threading.Condition(),
        'a ThreadPoolExecutor': ThreadPoolExecutor(),
        'sys': sys,
        'threading': threading,
        'concurrent.futures.thread': thread,
        'a kernel': Kernel,
        'an error that IPython shows': SimpleNamespace(
            **dict.fromkeys(re.findall(r'value\.(_\w+_)\(', inspect.getsource(interactiveshell)))
        ),
        'a comm': BaseComm,
        'a process of pexpect': pexpect.spawn,
        'quickjs-ng': SimpleNamespace(_quickjs=_quickjs),
    }
    node.destroy_node()
    executor.shutdown()
    context.shutdown()


class PrivateName(NamedTuple):
    """What a comment says of a private name: `owner` has it, in this version."""

    name: str
    owner: str
    version: str
    place: str


class Module:
    """A module of helpers: the private names that it uses, its own names, and its comments."""

    def __init__(self, path, text):
        self.path = Path(path)
        self.things = list(ast.walk(ast.parse(text)))
        self.uses = used(self.things)  # (line, name)
        self.own = defined(self.things)
        self.comments = comments(text)  # of each line that one is about, what it says

    def names(self):
        """Yield what the comments say of the names on their lines."""
        for line, name in sorted(self.uses):
            if line in self.comments:
                yield PrivateName(name, *self.comments[line], f'helpers/{self.path}:{line}')

    def idle_comments(self):
        """Return the lines that a comment is about, and that use no private name."""
        return sorted(self.comments.keys() - {line for line, _ in self.uses})


def modules():
    """Return each module of helpers."""
    files = sorted(HELPERS.rglob('*.py'))
    return [Module(file.relative_to(HELPERS), file.read_text()) for file in files]


def comments(text):
    """Return of each line with a comment `# private: ...` its owner and its version."""
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        said = COMMENT.fullmatch(token.string) if token.type == tokenize.COMMENT else None
        if said:
            alone = token.line.strip() == token.string
            found[token.start[0] + alone] = said.groups()
    return found


def used(things):
    """Return the private names that a module uses, each with its line, also as text for getattr."""
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
                names.add((thing.end_lineno, name))
            case ast.ImportFrom(module=str(module), names=imported, level=0) if (
                not module.startswith('helpers.')
            ):
                parts = [*module.split('.'), *(alias.name for alias in imported)]
                names.update((thing.lineno, part) for part in parts)
            case ast.Import(names=imported):
                parts = [part for alias in imported for part in alias.name.split('.')]
                names.update((thing.lineno, part) for part in parts)
    return {(line, name) for line, name in names if PRIVATE.fullmatch(name)}


def unexplained(modules):
    """Return the uses of private names of others that no comment is about: their places, names."""
    own = {(module.path.parts[0], name) for module in modules for name in module.own}
    return [
        f'helpers/{module.path}:{line}: {name}'
        for module in modules
        for line, name in sorted(module.uses)
        if line not in module.comments
        and (module.path.parts[0], name) not in own
        and name not in NO_SECRETS
    ]


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


ALL = modules()
NAMES = [name for module in ALL for name in module.names()]


def gone(owners, entry):
    """Return a sentence if the owner does not have the name any more, else None."""
    owner = owners[entry.owner]
    # A class of which an instance gets the name later.
    later = inspect.isclass(owner) and f'self.{entry.name} = ' in inspect.getsource(owner)
    if later or hasattr(owner, entry.name):
        return None
    return f'{entry.place}: {entry.owner} has no {entry.name} any more, as in {entry.version}.'


@pytest.mark.parametrize('entry', NAMES, ids=lambda entry: entry.name)
def test_a_name_is_still_there(owners, entry):
    assert gone(owners, entry) is None


def test_each_private_name_has_a_comment():
    assert unexplained(ALL) == [], 'Say beside each: # private: an executor, rclpy 7.1.6'


def test_each_comment_is_about_a_private_name():
    idle = [f'helpers/{module.path}:{line}' for module in ALL for line in module.idle_comments()]
    assert idle == []


def test_a_name_that_is_gone_is_told_with_its_version(owners):
    text = 'executor._is_shut = True  # private: an executor, rclpy 7.1.6'
    (entry,) = Module('ros/private.py', text).names()
    assert gone(owners, entry) == (
        'helpers/ros/private.py:1: an executor has no _is_shut any more, as in rclpy 7.1.6.'
    )


@pytest.mark.parametrize(
    'use',
    [
        *('executor._secret', "getattr(executor, '_secret', None)", 'from rclpy import _secret'),
        *('import rclpy._secret', 'from rclpy._secret import spin', "f'{_secret()}'._secret"),
    ],
)
@pytest.mark.parametrize(
    ('text', 'found'),
    [
        ('USE', ['helpers/ros/session.py:1: _secret']),
        ('\n# private: an executor, rclpy 7.1.6\n\nUSE', ['helpers/ros/session.py:4: _secret']),
        ('USE  # as we like it', ['helpers/ros/session.py:1: _secret']),
        ('# private: an executor, rclpy 7.1.6\nUSE', []),
        ('USE  # private: an executor, rclpy 7.1.6', []),
    ],
)
def test_a_name_without_a_comment_is_found(use, text, found):
    assert unexplained([Module('ros/session.py', text.replace('USE', use))]) == found


def test_a_comment_without_a_name_is_found():
    assert Module('a.py', 'x = 1  # private: an executor, rclpy 7.1.6').idle_comments() == [1]


def test_a_name_of_its_own_needs_no_comment():
    text = 'class Session:\n    def __init__(self):\n        self._secret = 1\n'
    assert unexplained([Module('ros/a.py', text), Module('ros/b.py', 'session._secret')]) == []


def test_where_a_thread_waits_can_be_seen():
    assert {'self', 'timeout'} <= set(inspect.signature(threading.Event.wait).parameters)
    assert 'work_queue.get(block=True)' in inspect.getsource(thread), (
        'An idle thread of a pool no longer waits in concurrent.futures.thread.'
    )
