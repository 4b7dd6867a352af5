"""Answers to the tasks of the lesson: wrong ones that students give, right ones of other forms."""

# ruff: noqa: E501  (answers are whole lines)

URDF = '%%write src/small_robot/urdf/small_robot.urdf part 2\n'


def joint(name, xyz, rpy, parent='base_link', link=None):
    return f"""  <link name="{link or name}"/>
  <joint name="{name}_joint" type="fixed">
    <parent link="{parent}"/>
    <child link="{name}"/>
    <origin xyz="{xyz}" rpy="{rpy}"/>
  </joint>
"""


GPS = joint('gps_link', '0 0 0.30', '0 0 0')
SCAN = joint('base_scan', '0 0 0.10', '0 0 -0.5236')
IMU = joint('imu_link', '0.05 0 0.03', '0 0 0.3491')
END = '</robot>\n'

TRANSFORMS = """
def static_transforms(robot):
    transforms = []
    for joint in robot.joints:
        if {condition}:
            message = TransformStamped(child_frame_id=joint.{child})
            message.header.frame_id = joint.{parent}
            x, y, z = joint.origin.xyz
            message.transform.translation = Vector3({shift})
            message.transform.rotation = quaternion({turn})
            transforms.append(message)
    return transforms
"""
PARTS = {
    'condition': "joint.type == 'fixed'",
    'child': 'child',
    'parent': 'parent',
    'shift': 'x=x, y=y, z=z',
    'turn': '*joint.origin.rpy',
}


def transforms(**changed):
    return TRANSFORMS.format(**(PARTS | changed))


BROADCASTER = """
class StaticBroadcaster(Node):
    def __init__(self, robot):
        super().__init__('robot_state_publisher')
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.{durability})
        self.publisher = self.create_publisher(TFMessage, '{topic}', qos)
        {publish}
"""
SAID = {
    'durability': 'TRANSIENT_LOCAL',
    'topic': '/tf_static',
    'publish': 'self.publisher.publish(TFMessage(transforms=static_transforms(robot)))',
}


def broadcaster(**changed):
    return BROADCASTER.format(**(SAID | changed))


POINTS = """
def points(scan, transform):
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    yaw, shift = yaw_of(transform.rotation), transform.translation
"""


def ends(angle='angles + yaw', x='shift.x', y='shift.y'):
    return POINTS + (
        f'    return {x} + scan.ranges * np.cos({angle}), {y} + scan.ranges * np.sin({angle})\n'
    )


def turned(expression, angle='secret'):
    return (
        f'my_angle = {angle}\n\n\n'
        f'def turned_back(table, angle):\n    return table.assign(imu_yaw={expression})\n'
    )


MARKER = "('share/ament_index/resource_index/packages', ['resource/small_robot'])"
XML = "('share/small_robot', ['package.xml'])"
URDF_PAIR = "('share/small_robot/urdf', ['urdf/small_robot.urdf'])"
YAML_PAIR = "('share/small_robot/config', ['config/localization.yaml'])"


def setup(*pairs, before='', after='', files=None):
    files = files or f'[{", ".join(pairs)}]'
    return f"""%%write src/small_robot/setup.py
from setuptools import setup
{before}
setup(name='small_robot', version='0.1.0', packages=['small_robot'], data_files={files})
{after}"""


SETTINGS = """%%write src/small_robot/config/localization.yaml
/**:
  ros__parameters:
    base_link_frame: base_footprint
    odom0: odom
    odom0_config: [false, false, false, false, false, false,
                   true, true, false, false, false, true, false, false, false]
    imu0: imu/data
    imu0_config: [false, false, false, false, false, true,
                  false, false, false, false, false, true, false, false, false]
ekf_odom:
  ros__parameters: {world_frame: odom}
ekf_map:
  ros__parameters:
    world_frame: map
    odom1: odometry/gps
    odom1_config: [true, true, false, false, false, false,
                   false, false, false, false, false, false, false, false, false]
    odom1_pose_rejection_threshold: 3.0
navsat_transform:
  ros__parameters: {datum: [10.7769, 106.7009, 0.0]}
"""
YAW = 'imu0_config: [false, false, false, false, false, true'


def start(*values, name='ekf_map'):
    listed = ', '.join(values)
    return f"""%%write src/small_robot/config/start.yaml
{name}:
  ros__parameters:
    initial_estimate_covariance: [{listed}]
"""


SURE = ['1.0e-9'] * 15

ANSWERS = {
    1: {
        'wrong': [
            URDF + GPS + SCAN + END,
            URDF + GPS + SCAN + joint('imu_link', '0.05 0 0.03', '0 0 20') + END,
            URDF + GPS + joint('base_scan', '0 0 0.10', '0 0 0.5236') + IMU + END,
            URDF + GPS + SCAN + joint('imu_link', '0.05 0 0.03', '0.3491 0 0') + END,
            URDF + GPS + SCAN + joint('imu_link', '0.05 0 0.03', '0 0 0.3491', 'base_lnk') + END,
            URDF + GPS + SCAN + joint('imu_link', '0.05 0 0.03', '0 0 0.3491', link='imu') + END,
            URDF + GPS + SCAN + joint('imu_link', '0.05 0 0.03', '0 0 0.3491', 'base_scan') + END,
            URDF + GPS + SCAN + IMU,
        ],
        'right': [
            URDF + IMU + SCAN + GPS + END,
            URDF + GPS + SCAN + joint('imu_link', '0.05 0.0 0.03', '0.0 0.0 0.34907') + END,
            URDF + GPS.replace(' rpy="0 0 0"', '') + SCAN + IMU + '  <!-- done -->\n' + END,
        ],
    },
    2: {
        'wrong': [
            transforms(condition='True'),
            transforms(child='parent', parent='child'),
            transforms(turn='0, 0, joint.origin.rpy[2]'),
            transforms(turn='*joint.origin.rpy[::-1]'),
            transforms(shift='x=x, y=y'),
            transforms(shift=''),
            transforms(condition="joint.type != 'fixed'"),
        ],
        'right': [
            transforms(condition="'fixed' in joint.type"),
            transforms(condition="joint.type not in ('continuous', 'revolute', 'prismatic')"),
            """
def static_transforms(robot):
    def made(joint):
        message = TransformStamped()
        message.header.frame_id, message.child_frame_id = joint.parent, joint.child
        shift = message.transform.translation
        shift.x, shift.y, shift.z = joint.origin.xyz
        roll, pitch, yaw = joint.origin.rpy
        message.transform.rotation = quaternion(roll, pitch, yaw)
        return message

    return [made(joint) for joint in robot.joints if joint.type == 'fixed']
""",
        ],
    },
    3: {
        'wrong': [
            broadcaster(durability='VOLATILE'),
            broadcaster(topic='/tf'),
            broadcaster(topic='/tff_static'),
            broadcaster(publish='pass'),
            broadcaster(publish='self.publisher.publish(static_transforms(robot))'),
            broadcaster(
                publish='for one in static_transforms(robot): '
                'self.publisher.publish(TFMessage(transforms=[one]))'
            ),
        ],
        'right': [
            broadcaster(topic='tf_static'),
            broadcaster(
                publish='self.publisher.publish(TFMessage(transforms=[*static_transforms(robot)]))'
            ),
            """
class StaticBroadcaster(Node):
    def __init__(self, robot):
        super().__init__('robot_state_publisher')
        latched = QoSProfile(depth=1)
        latched.durability = DurabilityPolicy.TRANSIENT_LOCAL
        message = TFMessage()
        message.transforms = static_transforms(robot)
        self.publisher = self.create_publisher(TFMessage, '/tf_static', latched)
        self.publisher.publish(message)
""",
        ],
    },
    4: {
        'wrong': [
            ends(angle='angles'),
            ends(angle='angles - yaw'),
            ends(x='0', y='0'),
            ends(x='shift.y', y='shift.x'),
            ends(x='-shift.x', y='-shift.y'),
            ends(angle='angles + transform.rotation.z'),
        ],
        'right': [
            ends(angle='yaw + angles'),
            ends().replace('np.arange(len(scan.ranges))', 'np.arange(0, len(scan.ranges), 1)'),
            POINTS
            + """
    x, y = scan.ranges * np.cos(angles), scan.ranges * np.sin(angles)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([cos * x - sin * y + shift.x, sin * x + cos * y + shift.y])
""",
        ],
    },
    5: {
        'wrong': [
            turned("table['imu_yaw']"),
            turned("table['imu_yaw'] + angle"),
            turned("table['imu_yaw'] - math.radians(angle)"),
            turned("table['imu_yaw'] - angle", angle='0.0'),
            turned("table['imu_yaw'] - angle", angle='-secret'),
            turned("table['imu_yaw'] - my_angle"),
            turned("table['imu_yaw'] - angle", angle='secret + 8'),
        ],
        'right': [
            turned("table['imu_yaw'] - angle", angle='secret + 3'),
            turned('table.imu_yaw.sub(angle)', angle='round(secret)'),
            'my_angle = secret - 2\n\n\n'
            'def turned_back(table, angle):\n'
            '    table = table.copy()\n'
            "    table['imu_yaw'] -= angle\n"
            '    return table\n',
        ],
    },
    6: {
        'wrong': [
            setup(MARKER, XML),
            setup(MARKER, XML, URDF_PAIR),
            setup(
                MARKER,
                XML,
                URDF_PAIR.replace('share/small_robot/urdf', 'share/small_robot'),
                YAML_PAIR,
            ),
            setup(MARKER, XML, URDF_PAIR, YAML_PAIR.replace('share/', '/share/')),
            setup(MARKER, XML, URDF_PAIR, YAML_PAIR.replace("'config/", "'configs/")),
        ],
        'right': [
            setup(YAML_PAIR, URDF_PAIR, XML, MARKER),
            setup(
                before="from glob import glob\nshare = 'share/small_robot'",
                files=f"[{MARKER}, (share, ['package.xml']), (share + '/urdf', glob('urdf/*')), "
                "(share + '/config', glob('config/*.yaml'))]",
            ),
            setup(
                before=f'files = [{MARKER}, {XML}]\n'
                "for folder, name in (('urdf', 'small_robot.urdf'), ('config', 'localization.yaml')):\n"
                "    files.append((f'share/small_robot/{folder}', [f'{folder}/{name}']))",
                files='files',
            ),
        ],
    },
    7: {
        'wrong': [
            SETTINGS.replace('imu/data', 'imu'),
            SETTINGS.replace('ekf_map', 'ekf_mpa'),
            SETTINGS.replace(YAW, YAW.replace('false, true', 'true, false')),
            SETTINGS.replace(YAW, YAW.replace('false, true', 'true, true')),
            SETTINGS.replace('world_frame: map', 'world_frame: odom'),
            SETTINGS.replace('odom1: odometry/gps', 'odom1: gps/fix'),
            SETTINGS.replace('imu/data', 'odom'),
            SETTINGS.replace(', false, false, false]\nekf_odom', ', false, false]\nekf_odom'),
            SETTINGS.replace('base_footprint', 'base_footprnt'),
        ],
        'right': [
            SETTINGS,
            SETTINGS.replace('imu/data', '/imu/data').replace('odom0: odom', 'odom0: /odom'),
            SETTINGS.replace('ekf_map', '/ekf_map').replace('ekf_odom', '/ekf_odom'),
        ],
    },
    8: {
        'wrong': [
            start(*SURE),
            start('1.0e-9', '1.0e-9', '9.0', *SURE[3:]),
            start('9.0', *SURE[1:]),
            start(*['9.0'] * 15),
            start('9.0', '9.0'),
            start('0.01', '0.01', *SURE[2:]),
            start('9.0', '9.0', *SURE[2:], name='ekf_mpa'),
        ],
        'right': [
            start('9.0', '9.0', *SURE[2:]),
            start('100.0', '25.0', *['0.000001'] * 13),
            start('9.0', '9.0', *SURE[2:], name='/ekf_map'),
        ],
    },
}
