# A callback waits for a lock, whose holder works.
import threading
import time

import rclpy

lock = threading.Lock()


def work():
    with lock:
        print('now', flush=True)
        time.sleep(8)


def tick():
    with lock:
        pass


rclpy.init()
node = rclpy.create_node('robot')
node.create_timer(0.5, tick)
threading.Thread(target=work, daemon=True).start()
rclpy.spin(node)
