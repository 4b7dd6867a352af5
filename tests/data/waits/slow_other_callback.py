# The server has only one thread, and another callback works in it for a while.
# Says: not yet, for think() holds the only thread of its executor
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

thinks = threading.Event()


def think():
    thinks.set()
    print('now', flush=True)
    time.sleep(8)


rclpy.init()
camera, person = rclpy.create_node('camera'), rclpy.create_node('person')
camera.create_timer(0.1, think)
camera.create_service(Trigger, 'look', lambda request, response: response)
client = person.create_client(Trigger, 'look')
for node in (camera, person):
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
thinks.wait()
client.call(Trigger.Request())
