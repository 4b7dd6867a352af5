# The package of launch_a_system as the lesson finds it: a driver, what it knows of a scan, setup.py.
# Run it in a workspace: it makes the folder `src/fleet_pkg`.
set -e
cd src
rm -rf fleet_pkg
ros2 pkg create fleet_pkg --build-type ament_python --license Apache-2.0 \
    --maintainer-name you --maintainer-email you@example.com \
    --dependencies rclpy geometry_msgs sensor_msgs std_srvs > /dev/null
cd fleet_pkg

cat > fleet_pkg/distance.py << 'END'
import math


def distance_ahead(scan):
    """Return how far the way ahead is free (m), or None if the scan does not say it."""
    beams, known = 0, []
    for i, r in enumerate(scan.ranges):
        angle = math.remainder(scan.angle_min + i * scan.angle_increment, math.tau)
        if abs(angle) > math.radians(10.01):
            continue
        beams += 1
        if r == math.inf:
            known.append(scan.range_max)  # nothing in range (REP 117)
        elif r == -math.inf:
            known.append(0.0)  # too near (REP 117)
        elif scan.range_min <= r <= scan.range_max and r > 0:
            known.append(r)
    return min(known) if known and len(known) >= beams / 2 else None
END

cat > fleet_pkg/driver.py << 'END'
import signal
import time

from fleet_pkg.distance import distance_ahead
from geometry_msgs.msg import Twist
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import LaserScan


class Driver(Node):
    def __init__(self):
        super().__init__('driver')
        self.speed = self.declare_parameter('speed', 0.5).value
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(LaserScan, 'scan', self.on_scan, newest)
        self.scan_s, steady = time.monotonic(), Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(0.1, self.watch, clock=steady)

    def on_scan(self, scan):
        self.scan_s = time.monotonic()
        self.get_logger().info(f'I drive at {self.speed} m/s', once=True)
        distance = distance_ahead(scan)
        command = Twist()
        if distance is not None and distance > 1.0:
            command.linear.x = self.speed
        self.publisher.publish(command)

    def watch(self):
        if time.monotonic() - self.scan_s > 0.5:  # no scan comes
            self.publisher.publish(Twist())

    def stop(self):
        self.publisher.publish(Twist())
        self.publisher.wait_for_all_acked(Duration(seconds=1))


def main():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    node = Driver()
    try:
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0.1)
    except KeyboardInterrupt:
        pass
    finally:
        node.stop()
        rclpy.try_shutdown()
END

cat > setup.py << 'END'
from setuptools import find_packages, setup

package_name = 'fleet_pkg'

setup(
    name=package_name,
    version='0.0.0',
    maintainer='you', maintainer_email='you@example.com',
    description='A driver for each robot of a fleet', license='Apache-2.0',
    extras_require={'test': ['pytest']},
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    entry_points={
        'console_scripts': [
            'driver = fleet_pkg.driver:main',
            'camera = fleet_pkg.camera:main',
        ],
    },
)
END
sed -i 's/TODO: Package description/A driver for each robot of a fleet/' package.xml
