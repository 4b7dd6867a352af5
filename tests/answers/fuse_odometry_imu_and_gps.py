"""Answers to the tasks of the lesson: wrong ones that students give, right ones of other forms."""

# ruff: noqa: E501  (answers are whole lines)

IMU = """
def imu_message(stamp, yaw, vyaw, ax, ay):
    message = Imu()
    message.header.stamp = stamp
    message.angular_velocity.z = vyaw
    message.angular_velocity_covariance = np.diag([VARIANCES['imu_vyaw']] * 3).ravel()
    {frame}
    message.linear_acceleration.x, message.linear_acceleration.y = ax, ay
    message.linear_acceleration.z = {gravity}
    message.linear_acceleration_covariance = np.diag([VARIANCES['ax']] * 3).ravel()
    if {condition}:
        {mark}
    else:
        message.orientation = quaternion_of(yaw)
        message.orientation_covariance = {covariance}
    return message
"""
FILLED = {
    'frame': "message.header.frame_id = 'imu_link'",
    'gravity': '9.81',
    'condition': 'yaw is None',
    'mark': 'message.orientation_covariance[0] = -1',
    'covariance': "np.diag([VARIANCES['imu_yaw']] * 3).ravel()",
}


def imu(**changed):
    return IMU.format(**(FILLED | changed))


READ = """
def from_imu(message):
    parts = [
        ('yaw', yaw_of(message.orientation), message.orientation_covariance, 8),
        ('vyaw', message.angular_velocity.z, message.angular_velocity_covariance, 8),
        ('ax', message.linear_acceleration.x, message.linear_acceleration_covariance, 0),
    ]
"""
FIX = """
DATUM = (10.7769, 106.7009, 0.0)


def from_fix(message):
    {guard}
    place = message.latitude, message.longitude, message.altitude
    east, north, up = pymap3d.geodetic2enu(*place, *DATUM)
    return [(('x', 'y'), {values}, {covariance})]
"""
TAKEN = {
    'guard': 'if message.status.status < NavSatStatus.STATUS_FIX: return []',
    'values': '(east, north)',
    'covariance': 'np.reshape(message.position_covariance, (3, 3))[:2, :2]',
}


def fix(**changed):
    return FIX.format(**(TAKEN | changed))


NODE = """
class FilterNode(Node):
    def __init__(self):
        super().__init__('ekf')
        self.ekf = fusion.ExtendedKalmanFilter()
        self.publisher = self.create_publisher(Odometry, 'odometry/filtered', 10)
        self.create_subscription(Odometry, 'odom', self.odom_callback, 10)
        self.create_subscription(Imu, '{imu}', self.imu_callback, 10)
        self.create_subscription(NavSatFix, '{gps}', self.gps_callback, 10)

    def take(self, stamp, readings):
        for names, values, covariance in readings:
            self.ekf.process({time}, names, values, covariance)

    def odom_callback(self, message):
        {first}
        {second}

    def imu_callback(self, message):
        self.take(message.header.stamp, from_imu(message))

    def gps_callback(self, message):
        self.take(message.header.stamp, {read}(message))
"""
NAMES = {
    'imu': 'imu/data',
    'gps': 'gps/fix',
    'time': 'seconds_of(stamp)',
    'first': 'self.take(message.header.stamp, from_odometry(message))',
    'second': (
        'p = self.ekf.covariance; self.publisher.publish(odometry_message('
        "self.ekf.t, 'odom', self.ekf.state, p[:3, :3], p[3:6, 3:6]))"
    ),
    'read': 'from_fix',
}


def node(**changed):
    return NODE.format(**(NAMES | changed))


def gate(body):
    return f'def is_taken(innovation, covariance, gate):\n    {body}\n'


def noise(body):
    return 'def best_noise(candidates, measurements, truth):\n' + body


OFF = 'rmse(fuse(measurements, process_noise={"x": n, "y": n}), truth)'

ANSWERS = {
    1: {
        'wrong': [
            'def quaternion_of(yaw):\n    return Quaternion(z=yaw, w=1.0)',
            'def quaternion_of(yaw):\n    return Quaternion(z=math.sin(yaw), w=math.cos(yaw))',
            'def quaternion_of(yaw):\n    return Quaternion(z=math.cos(yaw / 2), w=math.sin(yaw / 2))',
            'def quaternion_of(yaw):\n    return Quaternion(x=math.sin(yaw / 2), w=math.cos(yaw / 2))',
            'def quaternion_of(yaw):\n    Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))',
            'def quaternion_of(yaw):\n    return Quaternion(z=math.sin(yaw / 2))',
        ],
        'right': [
            'def quaternion_of(yaw):\n'
            '    made = Quaternion()\n'
            '    made.z, made.w = math.sin(yaw / 2), math.cos(yaw / 2)\n'
            '    return made',
            'def quaternion_of(yaw):\n'
            '    half = 0.5 * yaw\n'
            '    return Quaternion(x=0.0, y=0.0, z=float(np.sin(half)), w=float(np.cos(half)))',
            'def quaternion_of(yaw):\n    return Quaternion(z=-math.sin(yaw / 2), w=-math.cos(yaw / 2))',
            'from helpers.fusion.messages import quaternion\n'
            'def quaternion_of(yaw):\n    return quaternion(0.0, 0.0, yaw)',
        ],
    },
    2: {
        'wrong': [
            imu(frame='pass'),
            imu(gravity='0.0'),
            imu(gravity='-9.81'),
            imu(condition='not yaw'),
            imu(mark='message.angular_velocity_covariance[0] = -1'),
            imu(mark='pass'),
            imu(mark="message.orientation_covariance[0] = float('nan')"),
            imu(covariance="np.array([VARIANCES['imu_yaw']] * 9)"),
            imu(covariance="np.diag([math.sqrt(VARIANCES['imu_yaw'])] * 3).ravel()"),
        ],
        'right': [
            imu(mark='message.orientation_covariance = [-1.0] + [0.0] * 8'),
            imu(covariance="(VARIANCES['imu_yaw'] * np.eye(3)).flatten()"),
            imu(
                covariance="[VARIANCES['imu_yaw'], 0.0, 0.0, 0.0, VARIANCES['imu_yaw'], 0.0, 0.0, "
                "0.0, VARIANCES['imu_yaw']]"
            ),
        ],
    },
    3: {
        'wrong': [
            READ + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts]',
            READ + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts if c[p] != -1]',
            READ + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts if v != -1]',
            READ.replace('linear_acceleration_covariance, 0', 'linear_acceleration_covariance, 8')
            + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts if c[0] != -1]',
            READ.replace('velocity.z', 'velocity.x')
            + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts if c[0] != -1]',
            READ + '    if message.orientation_covariance[0] == -1:\n        return []\n'
            '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts]',
            READ.replace("('vyaw'", "('ay'")
            + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts if c[0] != -1]',
        ],
        'right': [
            READ + '    return [((n,), (v,), (c[p],)) for n, v, c, p in parts if c[0] >= 0]',
            READ + '    found = []\n'
            '    for n, v, c, p in parts:\n'
            '        if c[0] == -1:\n            continue\n'
            '        found += [([n], [v], [[c[p]]])]\n'
            '    return found',
            READ + '    known = filter(lambda part: part[2][0] != -1, parts)\n'
            '    return [((n,), (v,), np.array([c[p]])) for n, v, c, p in known]',
        ],
    },
    4: {
        'wrong': [
            fix(guard='pass'),
            fix(guard='if message.status.status <= NavSatStatus.STATUS_FIX: return []'),
            fix(guard='if message.status.status != NavSatStatus.STATUS_FIX: return []'),
            fix(values='(north, east)'),
            fix(covariance='(0.25, 0.25)'),
            fix(covariance='np.reshape(message.position_covariance, (3, 3))'),
            fix(covariance='message.position_covariance[:2]'),
            fix().replace('latitude, message.longitude', 'longitude, message.latitude'),
        ],
        'right': [
            fix(covariance='(message.position_covariance[0], message.position_covariance[4])'),
            fix(guard='if message.status.status == NavSatStatus.STATUS_NO_FIX: return []'),
            fix(values='[float(east), float(north)]'),
            fix(covariance='message.position_covariance.reshape(3, 3)[0:2, 0:2]'),
        ],
    },
    5: {
        'wrong': [
            node(imu='imu'),
            node(gps='gps'),
            node(time='self.get_clock().now().nanoseconds / 1e9'),
            node(second='pass'),
            node(first=NAMES['second'], second=NAMES['first']),
            node(
                second=NAMES['second'].replace('p[:3, :3], p[3:6, 3:6]', 'p[3:6, 3:6], p[:3, :3]')
            ),
            node(time='0.0'),
            node(read='from_imu'),
        ],
        'right': [
            node(time='Time.from_msg(stamp).nanoseconds / 1e9 - 1').replace(
                '\nclass', 'from rclpy.time import Time\n\n\nclass', 1
            ),
            node().replace(
                '(stamp), names, values, covariance', '(stamp), *(names, values, covariance)'
            ),
            node().replace(
                'self.imu_callback, 10', 'lambda m: self.take(m.header.stamp, from_imu(m)), 10'
            ),
        ],
    },
    6: {
        'wrong': [
            noise('    return candidates[-1]\n'),
            noise('    return 0.002\n'),
            noise('    return min(candidates)\n'),
            noise(f'    return max(candidates, key=lambda n: {OFF})\n'),
            noise(f'    return min({OFF} for n in candidates)\n'),
            noise(f'    for n in candidates:\n        off = {OFF}\n    return n\n'),
        ],
        'right': [
            noise(f'    return min(candidates, key=lambda n: {OFF})\n'),
            noise(
                f'    offs = [{OFF} for n in candidates]\n    return candidates[int(np.argmin(offs))]\n'
            ),
            noise(f'    return sorted(({OFF}, n) for n in candidates)[0][1]\n'),
        ],
    },
    7: {
        'wrong': [
            gate('return bool(innovation @ np.linalg.solve(covariance, innovation) < gate)'),
            gate('return bool(innovation @ np.linalg.solve(covariance, innovation) > gate * gate)'),
            gate('return bool(np.all(np.abs(innovation) < gate * np.sqrt(np.diag(covariance))))'),
            gate('return bool(innovation @ covariance @ innovation < gate * gate)'),
            gate('return bool(innovation @ np.linalg.solve(covariance, innovation) < 9)'),
            gate('return bool(np.sum(innovation**2 / np.diag(covariance)) < gate**2)'),
        ],
        'right': [
            gate('return innovation @ np.linalg.inv(covariance) @ innovation < gate**2'),
            gate(
                'return math.sqrt(innovation.dot(np.linalg.solve(covariance, innovation))) < gate'
            ),
            gate(
                'half = np.linalg.solve(np.linalg.cholesky(covariance), innovation)\n'
                '    return bool(np.linalg.norm(half) < gate)'
            ),
        ],
    },
}
