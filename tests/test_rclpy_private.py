"""The private names that we touch are all in one module, and are all still there."""

import ast
import inspect
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, thread
from importlib.metadata import version
from pathlib import Path

import pytest
import rclpy
from ipykernel.kernelbase import Kernel
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

from helpers._plumbing.rclpy_private import NAMES

CHECKOUT = Path(__file__).parents[1]


@pytest.fixture(scope='module')
def things():
    """One of each kind of thing that has private names."""
    context = rclpy.Context()
    context.init(domain_id=101)
    executor = MultiThreadedExecutor(2, context=context)
    node = rclpy.create_node('node', context=context)
    yield {
        'an executor': executor,
        'a MultiThreadedExecutor': executor,
        'a client': node.create_client(Trigger, 'look'),
        'an action client': ActionClient(node, Fibonacci, 'patrol'),
        'a ThreadPoolExecutor': ThreadPoolExecutor(),
        'a kernel': Kernel,
    }
    node.destroy_node()
    executor.shutdown()
    context.shutdown()


@pytest.mark.parametrize(
    ('kind', 'name'), [(kind, name) for kind, names in NAMES.items() for name in names]
)
def test_a_name_is_still_there(things, kind, name):
    read = NAMES[kind][name]
    now = f'rclpy {version("ros-rclpy")}' if 'rclpy' in read else f'not {read}'
    assert hasattr(things[kind], name), f'{kind} has no {name} any more: this is {now}, not {read}.'


def test_where_a_thread_waits_can_be_seen():
    assert {'self', 'timeout'} <= set(inspect.signature(threading.Event.wait).parameters)
    assert 'work_queue.get(block=True)' in inspect.getsource(thread), (
        'An idle thread of a pool no longer waits in concurrent.futures.thread.'
    )


COLLECTS = """
import gc, threading
from helpers._plumbing.rclpy_private import frames
gc.set_threshold(1)
for _ in range(1000):
    local = threading.local()
    local.itself = local
    del local
    [(_, frame)] = frames([threading.current_thread()])
    assert gc.isenabled()
print(frame.f_code.co_name)
"""


def test_frames_survive_a_garbage_collection():
    command = [sys.executable, '-c', COLLECTS]
    assert subprocess.check_output(command, cwd=CHECKOUT, timeout=60) == b'frames\n'


# What a module touches of a package for which rclpy_private.py is no place.
ELSEWHERE = {
    ('tests/test_session.py', '_callbacks'),  # a call whose answer comes while a session closes
    ('tests/test_session.py', '_pending_requests'),
    ('tests/test_session.py', '_set_executor'),
    ('tests/test_fusion_nodes.py', '_variances'),
    ('helpers/ros2/_commands.py', '_SubParsersAction'),  # argparse has no public name for it
    ('helpers/replay/model.py', '_quickjs'),  # `quickjs` starts a thread when it is imported
    (
        'tools/classroom/hub/jupyterhub_config.py',
        '_check_previous_process',
    ),  # in a class of JupyterHub's
}
# Of a namedtuple; of os; of sys, since Python 3.7; of Recording, for a class that inherits it.
PUBLIC = {'_replace', '_fields', '_exit', '_base_executable', '_heard'}


def test_private_names_are_in_one_module():
    folders = [CHECKOUT / name for name in ('helpers', 'tools', 'benchmarks', 'tests')]
    files = {CHECKOUT / 'conftest.py', *(f for top in folders for f in top.rglob('*.py'))}
    others = files - {CHECKOUT / 'helpers/_plumbing/rclpy_private.py'}
    found = {(str(f.relative_to(CHECKOUT)), name) for f in others for name in private_names(f)}
    assert found == ELSEWHERE


def private_names(file):
    """Return the private names that a module touches, without those that its classes define."""
    touched, own = set(), set()
    for part in ast.walk(ast.parse(file.read_text())):
        match part:
            case ast.Attribute(ast.Name('self' | 'cls'), name, ast.Store()):
                own.add(name)
            case ast.Attribute(attr=name):
                touched.add(name)
            case ast.Call(ast.Name('getattr'), [_, ast.Constant(name), *_]):
                touched.add(name)
            case ast.Import(names):
                touched |= {word for one in names for word in one.name.split('.')}
            case ast.ImportFrom(module, names) if not str(module).startswith('helpers'):
                touched |= {*str(module).split('.'), *(one.name for one in names)}
            case ast.ClassDef(body=body):
                own |= {getattr(one, 'name', '') for one in body}
    # One that ends with an underscore is of a protocol: of Python, or of IPython's displays.
    private = {name for name in touched if name.startswith('_') and not name.endswith('_')}
    return private - own - PUBLIC
