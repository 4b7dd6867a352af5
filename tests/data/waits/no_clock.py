# use_sim_time, and nobody publishes /clock.
# From: https://github.com/ros2/rclcpp/issues/1540
# Says: step() waits for a time of its clock that is 1 s ahead.
# Says: use_sim_time is true in sleeper, and nobody publishes /clock
# Says: set use_sim_time to false
import rclpy
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter


class Sleeper(Node):
    def __init__(self):
        sim = Parameter('use_sim_time', value=True)
        super().__init__('sleeper', parameter_overrides=[sim])
        clock = rclpy.clock.Clock(clock_type=ClockType.STEADY_TIME)
        self.timer = self.create_timer(0.1, self.step, clock=clock)

    def step(self):
        self.get_clock().sleep_for(Duration(seconds=1))


rclpy.init()
rclpy.spin(Sleeper())
