# Another node is spun; the one whose callback would finish the future is not.
# Says: waits for a future to be done (done).
# Says: finish(), of a timer of the node worker, would finish it
# Says: the node worker is in no executor
import rclpy
from rclpy.task import Future

rclpy.init()
boss, worker = rclpy.create_node('boss'), rclpy.create_node('worker')
done = Future()


def finish():
    done.set_result(True)


worker.create_timer(0.1, finish)
rclpy.spin_until_future_complete(boss, done)
