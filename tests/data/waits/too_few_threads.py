# Two callers hold both threads, so nobody is left for the server.
# Says: the answer of the service look
# Says: hold each of the 2 threads of its executor
# Says: MultiThreadedExecutor(num_threads=...)
import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

rclpy.init()
executor = MultiThreadedExecutor(2)
camera = Node('camera')
camera.create_service(Trigger, 'look', lambda request, response: response)
callers = Node('callers')
client = callers.create_client(Trigger, 'look', callback_group=ReentrantCallbackGroup())


def left():
    client.call(Trigger.Request())


def right():
    client.call(Trigger.Request())


for callback in (left, right):
    callers.create_timer(0.2, callback, callback_group=MutuallyExclusiveCallbackGroup())
executor.add_node(callers)
executor.add_node(camera)
executor.spin()

# Arrow: left() and right() > wait for > the answer of the service look
# Arrow: the answer of the service look > a lambda needs > the 2 threads
# Arrow: the 2 threads > held by > left() and right()
