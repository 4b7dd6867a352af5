"""The first pictures: of README and site, and of lessons whose own picture comes late on the page.

    python -m tools.lessons.first_pictures

It reads what the lessons have saved, and writes `notebooks/images/`: what is seen has happened.
A picture plays once, in 4.5 s. Without motion it is its own end.

Saved outputs and the code that draws make a picture, and nothing else does. So a file whose picture
is the same stays as it is, also where another zlib would compress its photographs to other bytes.
"""

import base64
import io
import re
from functools import partial

from PIL import Image

from helpers.lesson import FOLDER, PICTURES, lessons
from tools.lessons.first_pictures.bags import bag_picture
from tools.lessons.first_pictures.brakes import one_brake_picture, two_brakes_picture
from tools.lessons.first_pictures.calls import call_picture
from tools.lessons.first_pictures.drives import drive_picture
from tools.lessons.first_pictures.faults import faults_picture
from tools.lessons.first_pictures.queues import gate_picture, queue_picture, threads_picture
from tools.lessons.first_pictures.sensors import camera_picture, lidar_picture, wheels_picture
from tools.lessons.first_pictures.windows import (
    command_picture,
    program_picture,
    terminal_picture,
)

IMAGES = FOLDER / PICTURES
PHOTOGRAPH = re.compile(r'data:image/png;base64,([^"]*)')

# What each lesson shows first. What a learner guesses is not told.
FIRST = {
    'publish_and_subscribe': partial(
        drive_picture,
        cell_id='drive-the-square',
        around_m=(2.2, 0.4),
        asks='Which messages make it drive this square?',
    ),
    'lose_messages': partial(queue_picture, cell_id='step-through-run'),
    'run_callbacks_in_parallel': partial(
        threads_picture, cell_id='step-c-and-d-run', name='D', seconds=1.0
    ),
    'choose_the_number_of_threads': partial(gate_picture, cell_id='lesson-04-11'),
    'keep_what_is_fresh': one_brake_picture,
    'call_a_service_from_a_callback': partial(call_picture, cell_id='drive-deadlock'),
    'run_a_long_job': partial(
        drive_picture,
        cell_id='lesson-07-19',
        share=0.5,
        around_m=(9.0, 0.35),
        asks='Here the drive is canceled. What must your program do?',
    ),
    'set_parameters': partial(
        command_picture,
        cell_id='drive-15',
        command='ros2 param set /driver max_speed 0.0',
        drive='run-15-obey',
    ),
    'make_a_package': partial(
        terminal_picture,
        lines=[
            '$ colcon build',
            ('lesson-08-17', 'Starting'),
            ('lesson-08-17', 'Finished'),
            ('lesson-08-17', 'Summary'),
            '$ ros2 node list',
            ('nodes-08', '/'),
        ],
    ),
    'bring_in_a_package': partial(
        drive_picture,
        cell_id='l09-careful',
        around_m=(1.6, 0.7),
        asks='Whose code drives this robot?',
    ),
    'use_a_message_in_your_own_interface': partial(
        camera_picture, cell_id='lesson-10-45', degrees=[0, 45, 90, 135]
    ),
    'launch_a_system': partial(
        terminal_picture,
        lines=[
            '1 $ ros2 launch two_robots.launch.xml',
            '2 $ ros2 topic list | grep -E "scan|cmd_vel"',
            ('robots-shown-16', '/'),
            '1 $ ^C',
            ('ctrl-c-16', 'Programs'),
        ],
    ),
    'test_a_node': partial(
        terminal_picture,
        lines=[
            'def test_stops_before_a_wall(bench):',
            '    bench.send(0.25)',
            '    end = time.monotonic() + 0.15',
            '    while time.monotonic() < end:',
            '        bench.executor.spin_once(timeout_sec=0.05)',
            '    assert bench.speeds == [0.0]',
            ('lesson-17-flaky-runs', 'Runs passed'),
        ],
    ),
    'share_code_in_a_cpp_library': partial(drive_picture, cell_id='l11-replay'),
    'write_a_node_in_cpp': partial(
        program_picture,
        cell_id='cpp-12-task-3',
        lines=[
            '#include <geometry_msgs/msg/twist.hpp>',
            '#include <scan_tools/nearest.hpp>',
            '#include <small_rclcpp/small_rclcpp.hpp>',
            'using sensor_msgs::msg::LaserScan;',
            '// Your code: the class Brake',
        ],
        drive='cpp-12-drive',
    ),
    'fuse_odometry_imu_and_gps': wheels_picture,
    'put_the_sensors_on_the_robot': lidar_picture,
    'record_a_bag': partial(
        bag_picture, drive='bag0716d970', counts='bag91032ad7', ticks='bagfc074d50'
    ),
    'find_the_fault': partial(
        faults_picture,
        cells={'ada': 'drive-ada', 'bo': 'take-bo', 'cleo': 'take-cleo', 'dan': 'take-dan'},
    ),
    'build_a_robot_program': partial(drive_picture, cell_id='project-082'),
    'put_a_program_on_a_robot': partial(
        drive_picture,
        cell_id='crash-run',
        share=0.4,
        around_m=(9.0, 0.35),
        asks='Here its program is killed. What stops the robot?',
    ),
}


def pictures() -> dict[str, str]:
    """Return the SVG of each picture, by the name of its file in `notebooks/images/`."""
    of = {lesson.name: lesson for lesson in lessons()}
    made = {name: picture(of[name]) for name, picture in FIRST.items()}
    return made | {'depth_10_hits_depth_1_stops': two_brakes_picture(of['keep_what_is_fresh'])}


def is_same(svg: str, other: str) -> bool:
    """Whether two pictures show the same: all their text, and each pixel of their photographs."""
    return PHOTOGRAPH.split(svg)[::2] == PHOTOGRAPH.split(other)[::2] and all(
        _pixels(one) == _pixels(two)
        for one, two in zip(PHOTOGRAPH.findall(svg), PHOTOGRAPH.findall(other), strict=True)
    )


def _pixels(png: str) -> tuple[tuple[int, int], bytes]:
    image = Image.open(io.BytesIO(base64.b64decode(png))).convert('RGBA')
    return image.size, image.tobytes()


if __name__ == '__main__':
    for name, svg in pictures().items():
        file = IMAGES / f'{name}.svg'
        if not file.exists() or not is_same(svg, file.read_text(encoding='utf-8')):
            file.write_text(svg, encoding='utf-8')
            of = file.relative_to(FOLDER.parent)
            print(f'{of}: new, because outputs of its lesson or what draws it have changed')
