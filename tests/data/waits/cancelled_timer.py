# Only a timer sets the Event, and it was cancelled.
# Says: The program waits for an Event to be set (done).
# Says: It cannot: the timer was cancelled.
# Says: timer.reset()
import threading

import rclpy


def main():
    rclpy.init()
    node = rclpy.create_node('kitchen')
    done = threading.Event()

    def ring():
        done.set()

    timer = node.create_timer(60.0, ring)
    timer.cancel()
    threading.Thread(target=rclpy.spin, args=[node], daemon=True).start()
    done.wait()


main()
