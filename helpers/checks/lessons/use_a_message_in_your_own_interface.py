"""What the tasks of the lesson "Use a message in your own interface" are judged by."""

import json
import re
import threading
import time
from functools import partial

import numpy as np
from rclpy.node import Node
from rosidl_adapter.parser import parse_service_file
from sensor_msgs.msg import Image

from helpers.checks.bench import Bench
from helpers.checks.builds import builds
from helpers.checks.errors import Failed, sentence
from helpers.checks.points import all_of, cached, expect
from helpers.checks.programs import manifest, needed, sourced
from helpers.checks.tasks import Tasks
from helpers.robot import ROOMS, Robot

tasks = Tasks()
check = tasks.check

GENERATORS, RUNTIME = 'rosidl_default_generators', 'rosidl_default_runtime'
STOP = 'find_package(NAME REQUIRED), each time.'
BOTH = '<depend>NAME</depend> counts for the build and for the run.'


@tasks.add
def the_service_file(workspace, file):
    def has(part, right):
        try:
            service = parse_service_file('custom_interfaces', str(workspace.file(file)))
        except Exception as error:  # it has no type of its own: a separator, a type, a name
            raise Failed(sentence(error), hint='') from None
        fields = [f'{field.type} {field.name}' for field in getattr(service, part).fields]
        return fields == [right] or f'the {part} is {", ".join(fields) or "empty"}'

    request, response = 'float32 deg_turn', 'sensor_msgs/Image camera_image'
    line = 'The type, a space, the name.'
    of_package = 'A type without a package is one of your own package. Otherwise package/Type, '
    of_package += 'without msg.'
    return [
        ('the request is right', lambda: has('request', request), line),
        ('the response is right', lambda: has('response', response), of_package),
    ]


@tasks.add
def what_it_depends_on(workspace):
    package = 'custom_interfaces'

    def is_member():
        groups = [group.name for group in manifest(workspace, f'src/{package}').member_of_groups]
        said = f'its groups are {" ".join(groups)}' if groups else 'it is in no group'
        return 'rosidl_interface_packages' in groups or said

    def names(moment, name):
        return is_named(workspace, package, moment, name)

    line = 'One line <TAG>NAME</TAG>. The tag is in the text above the task.'
    return [
        ('the generators are named', lambda: names('build', GENERATORS), line),
        ('the runtime is named', lambda: names('run', RUNTIME), line),
        ('it is in the group of interface packages', is_member, line),
        ('sensor_msgs is named to build it', lambda: names('build', 'sensor_msgs'), BOTH),
        ('sensor_msgs is named to run it', lambda: names('run', 'sensor_msgs'), BOTH),
    ]


@tasks.add(limit_s=90)
def fix_the_build(workspace):
    hint = 'Unknown command: which package has it? KeyError: what was not told about the package?'
    return [
        ('it builds', lambda: builds(workspace, 'custom_interfaces', anew=False), hint),
        (
            'it stops if a package is missing',
            lambda: requires(workspace, 'custom_interfaces'),
            STOP,
        ),
    ]


@tasks.add
def the_server(CameraServer):
    def turns(degrees):
        with Bench() as bench:
            robot = Robot(ROOMS)
            node = bench.spin(CameraServer(robot))
            request = service_type().Request(deg_turn=degrees)
            response = bench.call('turn_camera', service_type(), request)
            if response is None:
                return no_answer(bench)
            return all_of(
                is_picture(response.camera_image, robot, degrees),
                expect(node.get_name(), 'camera', 'the name of the node is'),
            )

    hint = 'create_service(type, name, callback). The callback gets request and response.'
    return [
        ('it turns by 30 degrees, and shows it', lambda: turns(30.0), hint),
        ('it turns by 90 degrees, and shows it', lambda: turns(90.0), 'Return the response.'),
    ]


ASK_S = 5.0  # a session of the judge waits no longer for what never comes


@tasks.add(limit_s=45)
def the_client(ask, pixels):
    def wait_until(wait, predicate, timeout_s=ASK_S, **options):
        wait(predicate, min(timeout_s, ASK_S), **options)

    def asks(degrees):
        """Let the service come when the client is there already, and answer after a while."""
        with Bench() as bench:
            robot = Robot(ROOMS)
            bench.session.wait_until = partial(wait_until, bench.session.wait_until)
            node = bench.spin(Node('client'))
            later = threading.Timer(0.5, serve, (bench, robot, 0.5))
            later.start()
            begun_s = time.thread_time()
            try:
                image = ask(bench.session, node, degrees)
            finally:
                used_s = time.thread_time() - begun_s
                later.join()
            if used_s > 0.15:
                return 'it waits in a loop that uses a whole core'
            if not isinstance(image, Image):
                return f'it returns {type(image).__name__}, not an Image'
            return is_picture(image, robot, degrees)

    first = cached(lambda: asks(30.0))

    def asks_again():
        first()  # what it raises is raised again, without another call that waits
        return asks(120.0)

    def has_pixels(height, width):
        wanted = np.arange(height * width * 3, dtype=np.uint8).reshape(height, width, 3)
        image = Image(height=height, width=width, step=3 * width, data=wanted.tobytes())
        array = pixels(image)
        size = f'{height} by {width}'
        if np.shape(array) != wanted.shape:
            return f'{size} gives the wrong array: {np.shape(array)}'
        return np.array_equal(array, wanted) or f'{size} has its bytes at other places'

    ask_hint = (
        'create_client, then wait until client.service_is_ready; call_async, then wait until '
    )
    ask_hint += 'future.done.'
    shape_hint = '.reshape(image.height, image.width, 3)'
    return [
        ('ask(session, node, 30.0) returns the picture', first, ask_hint),
        ('ask(session, node, 120.0) returns the picture', asks_again, ask_hint),
        ('pixels of 4 by 6', lambda: has_pixels(4, 6), shape_hint),
        ('pixels of 6 by 4', lambda: has_pixels(6, 4), shape_hint),
    ]


@tasks.add
def call_from_a_terminal(workspace, commands):
    def turns_60():
        with Bench() as bench:
            robot = Robot(ROOMS)
            serve(bench, robot)
            printed = workspace.terminal(commands).splitlines()
        turns = turns_of(robot)
        if turns == ['The camera looks 60 degrees to the left.']:
            return True
        return ' '.join(turns or printed[-1:]) or 'the camera was not turned'

    hint = 'The field of the request, in braces: YAML.'
    return [('the camera turns by 60 degrees', turns_60, hint)]


@tasks.add(limit_s=90)
def a_message_of_two_packages(workspace):
    package = 'sighting_interfaces'

    def has_fields():
        kind = manifest(workspace, f'src/{package}').get_build_type()
        if kind != 'ament_cmake':
            raise Failed(f'its build_type is {kind}, not ament_cmake', hint='')
        built = builds(workspace, package)
        if built is not True:
            return built
        code = f'import json; from {package}.msg import Sighting; '
        code += 'print(json.dumps(Sighting.get_fields_and_field_types()))'
        said = sourced(workspace, f"python -c '{code}'").splitlines()[-1]
        if not said.startswith('{'):
            raise Failed(said, hint='')
        fields = [f'{kind} {name}' for name, kind in json.loads(said).items()]
        right = ['nav_msgs/Path way', 'sequence<sensor_msgs/Image> pictures']
        return fields == right or f'its fields are, in this order: {", ".join(fields)}'

    def names(moment, *wanted):
        return is_named(workspace, package, moment, *wanted)

    def exports():
        folder = workspace.file(f'install/{package}/share/{package}/cmake')
        said = ''.join(file.read_text() for file in folder.glob('ament_cmake_export_dependencies*'))
        return RUNTIME in said or f'it does not export {RUNTIME}'

    both = 'nav_msgs', 'sensor_msgs'
    whole = 'Which line of the error says what was not found? Steps 1 and 2.'
    line = 'The lines of step 1, one by one.'
    return [
        ('it builds, and has the two fields', has_fields, whole),
        ('both packages are named to build it', lambda: names('build', *both), BOTH),
        ('both packages are named to run it', lambda: names('run', *both), BOTH),
        ('the runtime of interfaces is named', lambda: names('run', RUNTIME), line),
        ('packages that use it get the runtime, too', exports, 'ament_export_dependencies(...)'),
        ('it stops if a package is missing', lambda: requires(workspace, package), STOP),
    ]


# --- The files of a package


def requires(workspace, package):
    """Return whether each find_package of a CMakeLists.txt says REQUIRED, or the first without.

    Its first command is cmake_minimum_required, or CMake only warns.
    """
    text = workspace.file(f'src/{package}/CMakeLists.txt').read_text()
    commands = re.findall(r'^\s*(\w+)\s*\(', text, re.MULTILINE)
    first = 'cmake_minimum_required'
    if commands and commands[0].lower() != first:
        return f'its first command is {commands[0]}, not {first}'
    calls = re.findall(r'^\s*find_package\(([^)]*)\)', text, re.MULTILINE | re.IGNORECASE)
    without = [call.strip() for call in calls if 'REQUIRED' not in call.split()]
    return not without or f'find_package({without[0]}) goes on without the package'


def is_named(workspace, package, moment, *wanted):
    """Return whether package.xml names these for 'build' or 'run', or what it does not name."""
    names = needed(manifest(workspace, f'src/{package}'), moment)
    missing = [name for name in wanted if name not in names]
    return not missing or f'to {moment} it, it does not name {" and ".join(missing)}'


# --- The camera


def service_type():
    """Return the learner's service. It is there when `fix_the_build` has built it."""
    from custom_interfaces.srv import TurnCamera

    return TurnCamera


def serve(bench, robot, takes_s=0.0):
    """Serve the camera of a robot, as `the_server` wants it. An answer takes some seconds."""

    def turn(request, response):
        response.camera_image = robot.turn_camera(request.deg_turn)
        time.sleep(takes_s)
        return response

    node = Node('camera')
    node.create_service(service_type(), 'turn_camera', turn)
    bench.spin(node)


def no_answer(bench):
    """Say why a call of turn_camera got no answer."""
    kinds = dict(bench.tester.get_service_names_and_types()).get('/turn_camera', [])
    if kinds == ['custom_interfaces/srv/TurnCamera'] and bench.tester.count_services('turn_camera'):
        return 'turn_camera is called, and does not answer'
    return 'there is no service turn_camera of the type TurnCamera'


def turns_of(robot):
    """Return what the robot's record says of its camera."""
    return [event.text for event in robot.record.events if event.kind == 'camera']


def is_picture(image, robot, degrees):
    """Return whether it is what the camera sees now, after one turn by the degrees."""
    turns = turns_of(robot)
    if turns != [f'The camera looks {degrees:g} degrees to the left.']:
        return ' '.join(turns) or 'the camera was not turned'
    seen = robot.turn_camera(0.0)
    right = image.data == seen.data and image.width == seen.width
    return right or 'the picture is not what the camera sees'
