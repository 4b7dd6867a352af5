"""The private names that we touch are all still there. Ruff keeps them in one module (SLF)."""

import inspect
import threading
from concurrent.futures import ThreadPoolExecutor, thread
from importlib.metadata import version

import pytest
import rclpy
from ipykernel.kernelbase import Kernel
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

from helpers.ros.private import NAMES


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
        'a lifecycle node': LifecycleNode('lifecycle', context=context),
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
