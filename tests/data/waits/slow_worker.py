# A worker waits for work, which a timer will bring.
import queue
import threading

import rclpy

work = queue.Queue()


def worker():
    print('now', flush=True)
    while True:
        work.get()


rclpy.init()
node = rclpy.create_node('boss')
node.create_timer(8.0, lambda: work.put(1))
threading.Thread(target=worker, daemon=True).start()
rclpy.spin(node)
