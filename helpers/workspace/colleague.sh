# What the colleague of bring_in_a_package has done: three packages, in a repository on a server.
# Run it in a workspace: it makes the folders `colleague` and `server`.
set -e
rm -rf colleague server
mkdir colleague
cd colleague
touch COLCON_IGNORE
options='--license Apache-2.0 --maintainer-name colleague --maintainer-email c@example.com'
ros2 pkg create --build-type ament_python $options --node-name brake brake
ros2 pkg create --build-type ament_python $options brake_tools
ros2 pkg create $options brake_gazebo
rm -r */test
sed -i '/test_depend/d' */package.xml
sed -i 's/^find_package(ament_cmake.*/&\nfind_package(gz_sim REQUIRED)/' */CMakeLists.txt
mkdir brake/config brake/launch
echo 'speed: 1.0  # m/s' > brake/config/brake.yaml
echo '<launch><node pkg="brake" exec="brake"/></launch>' > brake/launch/brake.launch.xml

cat > brake_tools/brake_tools/speed.py << 'END'
def nearest_ahead(ranges):
    return min(ranges[80:101])


def safe_speed(distance_m, speed):
    return speed if distance_m > 0.25 else 0.0
END

cat > brake/brake/brake.py << 'END'
import signal
import time
from pathlib import Path

import numpy as np
import rclpy
import yaml
from ament_index_python import get_package_share_directory
from brake_tools.speed import nearest_ahead, safe_speed
from geometry_msgs.msg import Twist
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import LaserScan


class Brake(Node):
    def __init__(self):
        super().__init__('brake')
        file = Path(get_package_share_directory('brake'), 'config', 'brake.yaml')
        self.speed = yaml.safe_load(file.read_text())['speed']
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(LaserScan, 'scan', self.listener_callback, newest)
        self.scan_s, steady = time.monotonic(), Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(0.1, self.watch, clock=steady)

    def listener_callback(self, scan):
        self.scan_s = time.monotonic()
        distance = nearest_ahead(np.array(scan.ranges))
        message = Twist()
        message.linear.x = float(safe_speed(distance, self.speed))
        self.publisher.publish(message)

    def watch(self):
        if time.monotonic() - self.scan_s > 0.5:  # no scan comes
            self.publisher.publish(Twist())

    def stop(self):
        self.publisher.publish(Twist())
        self.publisher.wait_for_all_acked(Duration(seconds=1))


def main():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    node = Brake()
    try:
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0.1)
    except KeyboardInterrupt:
        pass
    finally:
        node.stop()
        rclpy.try_shutdown()
END

# The branch jazzy, and an older one, humble, which the server names first.
commit='git -c user.name=colleague -c user.email=c@example.com commit --quiet'
git -c init.defaultBranch=humble init --quiet --bare ../server/brake.git
git init --quiet
git checkout --quiet -B jazzy
git add .
git reset --quiet COLCON_IGNORE
$commit --message=Brake
git checkout --quiet -B humble
git rm -r --quiet brake_tools
$commit --message=Old
git push --quiet ../server/brake.git jazzy humble
git checkout --quiet jazzy
