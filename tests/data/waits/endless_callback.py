# A callback drives in an endless loop, as a main() would: the service of its node is never served.
# Says: The program waits for the answer of the service stop.
# Says: It cannot: drive() holds the only thread of its executor
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

drives = threading.Event()


def drive():
    drives.set()
    while rclpy.ok():
        time.sleep(0.1)


rclpy.init()
driver, person = rclpy.create_node('driver'), rclpy.create_node('person')
driver.create_timer(0.1, drive)
driver.create_service(Trigger, 'stop', lambda request, response: response)
client = person.create_client(Trigger, 'stop')
for node in (driver, person):
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
drives.wait()
client.call(Trigger.Request())
