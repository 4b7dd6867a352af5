"""The graph at which the real command was pointed: its output is in outputs.json."""

import contextlib
import time

import rclpy
from geometry_msgs.msg import Twist
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.action import ActionServer
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState, Imu
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from test_msgs.action import Fibonacci

SPEED = FloatingPointRange(from_value=0.0, to_value=2.0)
WHEELS = IntegerRange(from_value=1, to_value=8, step=1)


def talker():
    node = Node('talker')
    chatter = node.create_publisher(String, 'chatter', 10)
    node.create_timer(0.5, lambda: chatter.publish(String(data='Hello World')))
    return node


def listener():
    node = Node('listener', namespace='/room')
    lossy = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_subscription(String, '/chatter', print, lossy)
    node.create_subscription(Twist, 'cmd_vel', print, 10)
    return node


def robot():
    node = Node('robot')
    about = ParameterDescriptor(description='Forward speed in m/s', floating_point_range=[SPEED])
    node.declare_parameter('speed', 0.5, about)
    about = ParameterDescriptor(description='How many', read_only=True, integer_range=[WHEELS])
    node.declare_parameter('wheels', 2, about)
    node.declare_parameters(
        '', [('frame', 'base_link'), ('gains', [1.0, 0.1, 0.01]), ('enabled', True)]
    )
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    state = BatteryState(
        voltage=12.5, percentage=0.75, location='left', cell_voltage=[4.1, 4.2, 4.2]
    )
    state.header.frame_id = 'base_link'
    node.create_publisher(BatteryState, 'battery', kept).publish(state)
    imu = node.create_publisher(Imu, 'imu/data', 10)
    node.create_timer(0.1, lambda: imu.publish(Imu()))

    def switch(request, response):
        response.success, response.message = True, 'on' if request.data else 'off'
        return response

    def refuse(request, response):
        response.message = 'no reset while driving'
        return response

    node.create_service(SetBool, 'motors', switch)
    node.create_service(Trigger, 'robot/reset', refuse)
    node.counting = ActionServer(node, Fibonacci, 'count', count)
    return node


def count(goal):
    numbers = [0, 1]
    for _ in range(goal.request.order - 2):
        numbers.append(numbers[-1] + numbers[-2])
        goal.publish_feedback(Fibonacci.Feedback(sequence=numbers))
        time.sleep(0.1)
    goal.succeed()
    return Fibonacci.Result(sequence=numbers)


rclpy.init()
executor = MultiThreadedExecutor()
nodes = [talker(), listener(), robot()]
for node in nodes:
    executor.add_node(node)
print('ready', flush=True)
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    executor.spin()
