"""Answers to the tasks of the lesson "Bring in a package": wrong ones, and right ones."""


def lines(name: str, text: str) -> str:
    """Return the cell that gives a name to these commands."""
    return f'{name} = """\n{text}\n"""\n'


def package_xml(depends: str) -> str:
    """Return the cell that writes `package.xml` with these lines."""
    return f"""%%write src/brake/brake/package.xml
<?xml version="1.0"?>
<package format="3">
  <name>brake</name>
  <version>0.0.0</version>
  <description>Brake before a wall</description>
  <maintainer email="c@example.com">colleague</maintainer>
  <license>Apache-2.0</license>
  {depends}
  <test_depend>python3-pytest</test_depend>
  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
"""


def tags(tag: str, names: str) -> str:
    """Return a line with the tag for each name."""
    return '\n  '.join(f'<{tag}>{name}</{tag}>' for name in names.split())


def setup(pairs: str) -> str:
    """Return the cell that writes `setup.py` with these lines in `data_files`."""
    return f"""%%write src/brake/brake/setup.py
from glob import glob

from setuptools import find_packages, setup

package_name = 'brake'

setup(
    name=package_name,
    version='0.0.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        {pairs}
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    license='Apache-2.0',
    entry_points={{'console_scripts': ['brake = brake.brake:main']}},
)
"""


def speed(body: str) -> str:
    """Return the cell that writes the function with this body."""
    return f"""%%write overlay/src/brake_tools/brake_tools/speed.py
def nearest_ahead(ranges):
    return min(ranges[80:101])


def safe_speed(distance_m, speed):
{body}
"""


def links(build: str, change: str) -> str:
    """Return the cell of task 6."""
    return lines('LINKS', build) + lines('CHANGE', change)


def create(options: str) -> str:
    """Return the cell that makes the package."""
    return lines('CREATE', f'cd overlay/src\nros2 pkg create {options}')


def table(text: str) -> str:
    """Return the cell that writes the executable."""
    return f'%%write overlay/src/speed_table/speed_table/table.py\n{text}'


FILE = 'src/brake/brake/config/brake.yaml'
ROS = 'rclpy ament_index_python geometry_msgs sensor_msgs brake_tools'
KEYS = 'python3-numpy python3-yaml'
LINKED = 'colcon build --symlink-install --packages-up-to brake'
FIRST = "('share/' + package_name + '/config', ['config/brake.yaml']),"
SECOND = "('share/' + package_name + '/launch', ['launch/brake.launch.xml']),"
OPTIONS = '--build-type ament_python --license Apache-2.0 --node-name table'
IMPORT = 'from brake_tools.speed import safe_speed\n\n\ndef main():\n'
RULE = """python3-yaml:
  ubuntu: [python3-yaml]
  opensuse: [python3-PyYAML]
  fedora: [python3-pyyaml]"""

ANSWERS = {
    1: {
        'wrong': [
            lines('CLONE', 'cd src\ngit clone ../server/brake.git'),
            lines('CLONE', 'git clone -b jazzy server/brake.git'),
            lines('CLONE', 'cd src\ngit clone -b jazzy server/brake.git'),
            lines('CLONE', 'cd src\ngit clone jazzy ../server/brake.git'),
            lines('CLONE', 'cd src\ngit clone -b rolling ../server/brake.git'),
            lines('CLONE', 'cd src\ncp -r ../colleague brake'),
        ],
        'right': [
            lines('CLONE', 'git clone -b jazzy server/brake.git src/brake'),
            lines('CLONE', 'cd src\ngit clone ../server/brake.git --branch jazzy'),
            lines('CLONE', 'cd src\ngit clone ../server/brake.git\ncd brake\ngit checkout jazzy'),
        ],
    },
    2: {
        'wrong': [
            package_xml(tags('depend', ROS)),
            package_xml(tags('depend', f'{ROS} numpy yaml')),
            package_xml(tags('exec_depend', f'{ROS} {KEYS} pathlib')),
            package_xml(tags('build_depend', f'{ROS} {KEYS}')),
            package_xml(tags('exec_depend', f'{ROS} {KEYS}'.replace('brake_tools', 'speed'))),
            package_xml(tags('exec_depend', f'{ROS} {KEYS}')[:-1]),
            package_xml(tags('test_depend', f'{ROS} {KEYS}')),
        ],
        'right': [
            package_xml(tags('depend', f'{ROS} {KEYS}')),
            package_xml(tags('exec_depend', f'{KEYS} {ROS}')),
            package_xml(tags('depend', ROS) + tags('exec_depend', KEYS)),
        ],
    },
    3: {
        'wrong': [
            lines('RULE', RULE.replace('PyYAML', 'yaml')),
            lines('RULE', RULE.replace('python3-yaml:\n', 'yaml:\n')),
            lines('RULE', RULE.replace(':', '')),
            lines('RULE', '\n'.join(RULE.splitlines()[:3])),
            lines('RULE', RULE.replace('fedora', 'Fedora')),
            lines('RULE', RULE.replace('  ', '')),
        ],
        'right': [
            lines('RULE', RULE.replace('  ', '    ')),
            lines('RULE', RULE.replace('[', '').replace(']', '')),
            lines('RULE', RULE.replace('[', '\n    - ').replace(']', '')),
        ],
    },
    4: {
        'wrong': [
            lines('BUILD', 'colcon build --packages-select brake'),
            lines('BUILD', 'colcon build --packages-up-to brake_tools'),
            lines('BUILD', 'colcon build --packages-up-to brake brake_gazebo'),
            lines('BUILD', 'colcon build --continue-on-error'),
            lines('BUILD', 'colcon build brake'),
        ],
        'right': [
            lines('BUILD', 'colcon build --packages-select brake_tools brake'),
            lines('BUILD', 'colcon build --packages-skip brake_gazebo'),
            lines('BUILD', 'colcon build --packages-ignore brake_gazebo --symlink-install'),
        ],
    },
    5: {
        'wrong': [
            setup(FIRST),
            setup(FIRST + SECOND.replace('launch/brake', 'brake')),
            setup("('share/' + package_name, ['config/brake.yaml', 'launch/brake.launch.xml']),"),
            setup(FIRST.rstrip(',') + SECOND),
            setup(FIRST + SECOND.replace("'/launch'", "'launch'")),
        ],
        'right': [
            setup(SECOND + FIRST),
            setup(
                "('share/brake/config', glob('config/*')), ('share/brake/launch', glob('launch/*'))"
            ),
            setup("*[(f'share/brake/{f}', glob(f'{f}/*')) for f in ('config', 'launch')],"),
        ],
    },
    6: {
        'wrong': [
            links('colcon build --packages-up-to brake', f"echo 'speed: 0.3' > {FILE}"),
            links(LINKED, "echo 'speed: 0.3' > brake.yaml"),
            links(LINKED, f"echo 'speed: 0.3' >> {FILE}"),
            links(LINKED, f"echo '0.3' > {FILE}"),
            links(LINKED.replace('symlink-install', 'symlink'), f"echo 'speed: 0.3' > {FILE}"),
            links(LINKED.replace('to brake', 'to brake_tools'), f"echo 'speed: 0.3' > {FILE}"),
        ],
        'right': [
            links(LINKED, f"sed -i 's/speed.*/speed: 0.3/' {FILE}"),
            links(
                'colcon build --packages-select brake brake_tools --symlink-install',
                "cd src/brake/brake\necho 'speed:   0.3  # m/s' > config/brake.yaml",
            ),
            links(LINKED, f'printf "speed: 0.3\\\\n" | tee {FILE}'),
        ],
    },
    7: {
        'wrong': [
            speed('    return 0.0'),
            speed('    return speed if distance_m > 0.5 else 0.0'),
            speed(
                '    if distance_m < 1.0:\n        return speed / 2\n    if distance_m < 0.5:\n'
                '        return 0.0\n    return speed'
            ),
            speed(
                '    if distance_m < 0.5:\n        return 0.0\n    if distance_m < 1.0:\n'
                '        return 0.4\n    return 0.8'
            ),
            speed(
                '    if distance_m < 0.5:\n        return 0.0\n    if distance_m < 1.0:\n'
                '        return speed / 2'
            ),
            speed('    if distance_m < 0.5\n        return 0.0\n    return speed'),
        ],
        'right': [
            speed('    return 0 if distance_m < 0.5 else speed / 2 if distance_m < 1 else speed'),
            speed(
                '    if distance_m >= 1:\n        return speed\n    if distance_m >= 0.5:\n'
                '        return 0.5 * speed\n    return 0'
            ),
            speed('    return speed * ((distance_m >= 0.5) + (distance_m >= 1.0)) / 2'),
        ],
    },
    8: {
        'wrong': [
            create(f'{OPTIONS} speed_table'),
            create(
                '--dependencies brake_tools --license Apache-2.0 --node-name table -- speed_table'
            ),
            create(f'{OPTIONS} --dependencies brake_tools speed_table'),
            create(f'{OPTIONS} --dependencies rclpy brake_tools -- speed_table'),
            create(
                'speed_table --build-type ament_python --node-name table --dependencies brake_tools'
            ),
            create(
                'speed_table --build-type ament_python --license BSD --dependencies brake_tools'
            ),
        ],
        'right': [
            create(f'speed_table {OPTIONS} --dependencies brake_tools'),
            create(f'--dependencies brake_tools {OPTIONS} speed_table'),
            lines(
                'CREATE',
                f'ros2 pkg create --destination-directory overlay/src speed_table {OPTIONS}'
                ' --dependencies brake_tools',
            ),
        ],
    },
    9: {
        'wrong': [
            table(
                IMPORT
                + '    print(safe_speed(0.4, 0.8), safe_speed(0.8, 0.8), safe_speed(2, 0.8))\n'
            ),
            table(IMPORT + '    for d in (0.4, 0.8, 2.0):\n        print(safe_speed(0.8, d))\n'),
            table(IMPORT + '    for d in (0.4, 0.8):\n        print(safe_speed(d, 0.8))\n'),
            table(
                'from speed import safe_speed\n\n\ndef main():\n    print(safe_speed(0.4, 0.8))\n'
            ),
            table(
                'def main():\n    for d in (0.4, 0.8, 2.0):\n        print(safe_speed(d, 0.8))\n'
            ),
            table(
                'from brake_tools.speed import safe_speed\nfor d in (0.4, 0.8, 2.0):\n'
                '    print(safe_speed(d, 0.8))\n'
            ),
        ],
        'right': [
            table(
                'import brake_tools.speed\n\n\ndef main():\n    for d in 0.4, 0.8, 2.0:\n'
                '        print(brake_tools.speed.safe_speed(d, 0.8))\n'
            ),
            table(
                IMPORT + '    print(safe_speed(0.4, 0.8))\n    print(safe_speed(0.8, 0.8))\n'
                '    print(safe_speed(2.0, speed=0.8))\n'
            ),
            table(
                'from brake_tools import speed\n\n\ndef main():\n'
                "    print(*[speed.safe_speed(d, 0.8) for d in (0.4, 0.8, 2.0)], sep='\\n')\n"
            ),
        ],
    },
}
