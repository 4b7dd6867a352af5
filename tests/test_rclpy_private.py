"""The private names that we touch are all in one module, and are all still there."""

import ast
import inspect
import threading
from concurrent.futures import ThreadPoolExecutor, thread
from importlib.metadata import version
from pathlib import Path

import pytest
import rclpy
from ipykernel.kernelbase import Kernel
from rclpy.executors import MultiThreadedExecutor
from std_srvs.srv import Trigger

from helpers.rclpy_private import NAMES

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


def test_no_other_module_touches_a_private_name_that_is_not_ours():
    ours, touched = set(), set()
    folders = [CHECKOUT / name for name in ('helpers', 'tools', 'benchmarks', 'tests')]
    for file in (CHECKOUT / 'conftest.py', *(f for top in folders for f in top.rglob('*.py'))):
        for name, defined in private_names(file):
            if defined:
                ours.add(name)
            elif file.name != 'rclpy_private.py':
                touched.add((name, file.name))
    assert {(name, file) for name, file in touched if name not in ours} == set()


PUBLIC = ('_replace', '_base_executable')  # of a namedtuple; of sys, since Python 3.7


def private_names(file):
    """Yield each private name in a module, and whether it is defined there."""
    for part in ast.walk(ast.parse(file.read_text())):
        if isinstance(part, ast.Attribute):
            name, here = part.attr, isinstance(part.ctx, ast.Store)
            here |= isinstance(part.value, ast.Name) and part.value.id in ('self', 'cls')
        elif isinstance(part, ast.Call) and ast.unparse(part.func) == 'getattr':
            name, here = str(getattr(part.args[1], 'value', '')), False
        elif isinstance(part, ast.FunctionDef | ast.ClassDef):
            name, here = part.name, True
        elif isinstance(part, ast.Name):
            name, here = part.id, isinstance(part.ctx, ast.Store)
        else:
            continue
        if name.startswith('_') and not name.endswith('__') and name not in PUBLIC:
            yield name, here
