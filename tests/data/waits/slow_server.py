# The answer comes late: the server works on it.
# Says: would answer: it works on it, at line 14: time.sleep(8)
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger


def look(request, response):
    print('now', flush=True)
    # A camera takes its time.
    time.sleep(8)
    return response


rclpy.init()
camera, person = rclpy.create_node('camera'), rclpy.create_node('person')
camera.create_service(Trigger, 'look', look)
client = person.create_client(Trigger, 'look')
for node in (camera, person):
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
client.call(Trigger.Request())
