# The program is at its end, and a thread that is no daemon goes on.
# Says: waits for threads that have not ended.
# Says: the end of the program
# Says: the thread watch would end.
# Says: `while True` in line 13 has no end
import threading
import time

import rclpy


def watch():
    while True:
        time.sleep(0.1)


rclpy.init()
node = rclpy.create_node('watcher')
threading.Thread(target=watch, name='watch').start()
node.destroy_node()
rclpy.shutdown()
