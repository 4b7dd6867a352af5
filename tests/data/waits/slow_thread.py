# The main thread joins a thread that works, and ends.
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor

rclpy.init()
node = rclpy.create_node('worker')
executor = SingleThreadedExecutor()
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()


def work():
    print('now', flush=True)
    for _ in range(80):
        time.sleep(0.1)


thread = threading.Thread(target=work)
thread.start()
thread.join()
