# A thread without an end is joined.
# Says: The program waits for the end of the thread talks.
# Says: `while rclpy.ok()` in line 15 has no end
# Says: Give the loop an end
import threading
import time

import rclpy

rclpy.init()
node = rclpy.create_node('talker')


def talk():
    while rclpy.ok():
        time.sleep(0.1)


thread = threading.Thread(target=talk, name='talks')
thread.start()
thread.join()
rclpy.shutdown()
