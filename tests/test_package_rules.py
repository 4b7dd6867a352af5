"""A good package lacks nothing; with one edit, it lacks one thing, and the answer is Jazzy's."""

import re

import pytest
from catkin_pkg.package import parse_package
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helpers.cmake_lists import CMakeLists
from helpers.interfaces import installed_names, share_folder
from helpers.package_rules import check_package

# As `ros2 pkg create` begins it.
CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(custom_interfaces)

if(CMAKE_COMPILER_IS_GNUCXX OR CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  add_compile_options(-Wall -Wextra -Wpedantic)
endif()

# find dependencies (all)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(sensor_msgs REQUIRED) # Add packages that the custom interfaces depend on

rosidl_generate_interfaces(${PROJECT_NAME}
  "srv/TurnCamera.srv"
  DEPENDENCIES sensor_msgs # Add packages that the custom interfaces depend on
)

if(BUILD_TESTING AND (NOT OFF))
  message(STATUS "a ) in quotes")
endif()
ament_package()
"""
MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>custom_interfaces</name>
  <version>0.0.0</version>
  <description>TODO: Package description</description>
  <maintainer email="user@todo.todo">user</maintainer>
  <license>TODO: License declaration</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>sensor_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
SRV = 'float32 deg_turn\n---\nsensor_msgs/Image camera_image\n'
FILES = {'CMakeLists.txt': CMAKE, 'package.xml': MANIFEST, 'srv/TurnCamera.srv': SRV}


@pytest.fixture
def package(tmp_path):
    """Write the good package, with the given files instead. None leaves a file out."""

    def package(files=None, name='custom_interfaces'):
        root = tmp_path / 'src' / name
        for file, text in {**FILES, **(files or {})}.items():
            if text is not None:
                (root / file).parent.mkdir(parents=True, exist_ok=True)
                (root / file).write_text(text, encoding='utf-8')
        return root

    return package


def edited(file, old, new=''):
    assert old in FILES[file]
    return {file: FILES[file].replace(old, new)}


def test_the_good_package_lacks_nothing(package):
    findings = check_package(package())
    assert findings == ()
    assert repr(findings) == '[ok] Nothing is missing.'


# What is taken out, what check_package then asks for, and what Jazzy answered, or did.
WITHOUT = [
    ('find_package(ament_cmake REQUIRED)', 'find_package(ament_cmake REQUIRED)', 'it builds, only'),
    (
        'find_package(rosidl_default_generators REQUIRED)',
        'find_package(rosidl_default_generators REQUIRED), before rosidl_generate_interfaces()',
        'Unknown CMake command "rosidl_generate_interfaces"',
    ),
    (
        'find_package(sensor_msgs REQUIRED)',
        'find_package(sensor_msgs REQUIRED), before rosidl_generate_interfaces()',
        '"the passed dependency \'sensor_msgs\' has not been found before using find_package()"',
    ),
    (
        'DEPENDENCIES sensor_msgs',
        'DEPENDENCIES sensor_msgs in rosidl_generate_interfaces(), for srv/TurnCamera.srv',
        "KeyError: 'sensor_msgs', from rosidl_generator_type_description",
    ),
    (
        CMAKE[CMAKE.index('rosidl_generate') : CMAKE.index('if(BUILD')],
        'rosidl_generate_interfaces(${PROJECT_NAME} "srv/TurnCamera.srv" ...)',
        'it builds, but without any interface',
    ),
    ('endif()\nament_package(', "a ')' for each '(', and no more", '"Parse error."'),
    ('ament_package()', 'ament_package(), at the end', 'not found: .../local_setup.bash'),
    (CMAKE, 'the file', 'does not appear to contain CMakeLists.txt'),
    (
        '<buildtool_depend>ament_cmake</buildtool_depend>',
        '<buildtool_depend>ament_cmake</buildtool_depend>',
        'elsewhere "ament_cmakeConfig.cmake" is not found',
    ),
    (
        '<buildtool_depend>rosidl_default_generators</buildtool_depend>',
        '<buildtool_depend>rosidl_default_generators</buildtool_depend>',
        'elsewhere "rosidl_default_generatorsConfig.cmake" is not found',
    ),
    (
        '<depend>sensor_msgs</depend>',
        '<depend>sensor_msgs</depend>',
        'it builds only where sensor_msgs is installed already; elsewhere '
        '"sensor_msgsConfig.cmake" is not found',
    ),
    (
        '<exec_depend>rosidl_default_runtime</exec_depend>',
        '<exec_depend>rosidl_default_runtime</exec_depend>',
        'it builds; a machine that only runs it',
    ),
    (
        '<member_of_group>rosidl_interface_packages</member_of_group>',
        '<member_of_group>rosidl_interface_packages</member_of_group>',
        '"Packages installing interfaces must include '
        "'<member_of_group>rosidl_interface_packages</member_of_group>'\"",
    ),
    (
        '<build_type>ament_cmake</build_type>',
        '<build_type>ament_cmake</build_type> in <export>',
        "colcon builds it as 'catkin': setup.bash does not add it to AMENT_PREFIX_PATH, and "
        '"ros2 interface show" says "Unknown package \'custom_interfaces\'"',
    ),
    ('</export>', 'a manifest that colcon can read', 'InvalidPackage: The manifest contains inv'),
    (MANIFEST, 'the file', 'colcon does not see a ROS package here'),
]


@pytest.mark.parametrize(('line', 'missing', 'error'), WITHOUT)
def test_a_line_that_is_left_out(package, line, missing, error):
    file = 'CMakeLists.txt' if line in CMAKE else 'package.xml'
    findings = check_package(package({file: FILES[file].replace(line, '') or None}))
    ((where, what, answer),) = findings
    assert (where, what) == (file, missing)
    assert error in answer
    lines = repr(findings).splitlines()
    assert lines[0].startswith(f'[missing] {file}: ')
    assert any(line.startswith('          Without it: ') for line in lines)
    assert max(map(len, lines)) <= 94


# The definition of the service, and what it lacks. What Jazzy answers is its parser's own error,
# except where the generators fail later.
DEFINITIONS = [
    ('---', '--', 'one line that is exactly ---', 'InvalidServiceSpecification: Could not find se'),
    ('---', '---\n---', 'one line that is exactly ---', 'Could not find unique separator'),
    ('sensor_msgs/Image', 'Image', "the package of the type Image of 'camera_image', for example "
     'sensor_msgs/Image', "FileNotFoundError: [Errno 2] No such file or directory: "
     "'.../custom_interfaces/msg/Image.json'"),
    ('/Image', '/Imagee', 'a message that exists: sensor_msgs has no Imagee. The nearest is '
     'sensor_msgs/Image', "'.../sensor_msgs/msg/Imagee.json'"),
    ('sensor_msgs/', 'sensor_msg/', 'the package sensor_msg, which is neither installed nor in '
     'this workspace. Is it sensor_msgs?', 'does not find "sensor_msgConfig.cmake"'),
    ('s/Image', 's/msg/Image', 'sensor_msgs/Image in place of sensor_msgs/msg/Image: in a '
     'definition a type has no /msg/', 'InvalidResourceName: sensor_msgs/msg/Image'),
    ('float32', 'float', 'a type that exists, float32 or float64, in place of float', "'float'"),
    ('float32', 'int', 'a type that exists, int32 or int64, in place of int', "'int'"),
    ('deg_turn', 'degTurn', 'a definition that rosidl can read', "NameError: 'degTurn' is an inv"),
]  # fmt: skip


@pytest.mark.parametrize(('old', 'new', 'missing', 'error'), DEFINITIONS)
def test_a_definition_with_a_mistake(package, old, new, missing, error):
    ((file, what, answer),) = check_package(package(edited('srv/TurnCamera.srv', old, new)))
    assert file == 'srv/TurnCamera.srv'
    assert what.startswith(missing)
    assert error in answer


@pytest.mark.parametrize(
    ('file', 'text', 'missing', 'error'),
    [
        ('msg/turn_camera.msg', 'bool on', 'CamelCase', "InvalidResourceName: 'turn_camera' is an"),
        ('srv/turn_camera.srv', '---', 'CamelCase', "InvalidResourceName: 'turn_camera_Request'"),
        ('action/Turn.action', 'bool on\n---\n', 'two lines that are exactly ---: goal, result and',
         'InvalidActionSpecification'),
        ('msg/Goal.msg', 'Header header', 'for example std_msgs/Header', 'msg/Header.json'),
    ],
)  # fmt: skip
def test_another_file_with_a_mistake(package, file, text, missing, error):
    listed = edited('CMakeLists.txt', '"srv/TurnCamera.srv"', f'"srv/TurnCamera.srv" {file}')
    ((where, what, answer),) = check_package(package({file: text, **listed}))
    assert where == file
    assert missing in what
    assert error in answer


def test_a_file_that_is_not_listed(package):
    (finding,) = check_package(package({'srv/More.srv': '---\n'}))
    assert finding[:2] == ('CMakeLists.txt', '"srv/More.srv" in rosidl_generate_interfaces()')
    assert finding.error.startswith('it builds, but without this interface')


def test_commas_after_dependencies(package):
    files = edited('CMakeLists.txt', 'DEPENDENCIES ', 'DEPENDENCIES std_msgs, ')
    files |= edited('package.xml', '<depend>', '<depend>std_msgs</depend><depend>')
    ((_, missing, error),) = check_package(package(files))
    assert missing == 'blanks in place of commas after DEPENDENCIES: std_msgs,'
    assert "the passed dependency 'std_msgs,' has not been found" in error


def test_a_find_package_that_comes_too_late(package):
    line = 'find_package(sensor_msgs REQUIRED)'
    text = CMAKE.replace(line, '').replace('ament_package()', f'{line}\nament_package()')
    (finding,) = check_package(package({'CMakeLists.txt': text}))
    assert finding.missing == f'{line}, before rosidl_generate_interfaces()'


def test_a_package_that_is_used_and_nowhere_named(package):
    files = {
        'action/Turn.action': 'nav_msgs/Path path\n---\n---\ngeometry_msgs/Point[<=2] corners\n'
    }
    files |= edited('CMakeLists.txt', '"srv/', 'action/Turn.action "srv/')
    findings = check_package(package(files))
    assert [(finding.file, finding.missing.split(',')[0]) for finding in findings] == [
        # sensor_msgs brings geometry_msgs.
        ('CMakeLists.txt', 'DEPENDENCIES nav_msgs in rosidl_generate_interfaces()'),
        ('CMakeLists.txt', 'find_package(nav_msgs REQUIRED)'),
        ('package.xml', '<depend>nav_msgs</depend>'),
    ]
    assert findings[1].error.startswith('with DEPENDENCIES alone: "the passed dependency')


def test_ament_cmake_ros_brings_ament_cmake(package):
    files = edited('CMakeLists.txt', 'ament_cmake REQ', 'ament_cmake_ros REQ')
    files |= edited('package.xml', 'ament_cmake</buildtool', 'ament_cmake_ros</buildtool')
    assert check_package(package(files)) == ()


def test_what_comes_with_others_is_not_asked_for(package):
    # service_msgs brings builtin_interfaces to each service, and sensor_msgs brings std_msgs.
    srv = 'builtin_interfaces/Time at\nstd_msgs/Header header\n---\nsensor_msgs/Image image\n'
    assert check_package(package({'srv/TurnCamera.srv': srv})) == ()


def test_a_package_beside_it_and_an_own_message(package):
    name = 'camera_interfaces'
    package({file: text.replace('custom_interfaces', name) for file, text in FILES.items()}, name)
    files = {file: text.replace('sensor_msgs', name) for file, text in FILES.items()}
    files['CMakeLists.txt'] = files['CMakeLists.txt'].replace('"srv', 'msg/Goal.msg "srv')
    files['msg/Goal.msg'] = 'int8 x\n'
    files['srv/TurnCamera.srv'] = 'Goal goal\n---\ncamera_interfaces/Shot shot\n'
    root = package(files)
    (finding,) = check_package(root)
    assert finding.missing.startswith('a message that exists: camera_interfaces has no Shot')
    package({'msg/Shot.msg': 'int8 x\n'}, name)
    assert check_package(root) == ()


@pytest.mark.parametrize(
    'form',
    [
        'find_package(sensor_msgs)\nset(srvs "srv/TurnCamera.srv")\nset(needed\n sensor_msgs)\n'
        'ROSIDL_GENERATE_INTERFACES(${PROJECT_NAME} ${srvs} DEPENDENCIES ${needed} SKIP_INSTALL)',
        'find_package(sensor_msgs)\nset(srvs)\nlist(APPEND srvs srv/TurnCamera.srv)\n'
        'rosidl_generate_interfaces(x DEPENDENCIES "sensor_msgs" LIBRARY_NAME y '
        'SKIP_INSTALL ${srvs})',
        'foreach(package sensor_msgs)\nfind_package(${package} REQUIRED)\nendforeach()\n'
        'file(GLOB srvs "srv/*.srv")\n'
        'rosidl_generate_interfaces(${PROJECT_NAME} ${srvs} DEPENDENCIES ${needed})',
        'find_package(ament_cmake_auto REQUIRED)\nament_auto_find_build_dependencies()\n'
        'rosidl_generate_interfaces(x srv/TurnCamera.srv DEPENDENCIES sensor_msgs)',
    ],
)
def test_no_false_alarm_on_other_forms(package, form):
    body = CMAKE[CMAKE.index('find_package(sensor_msgs') : CMAKE.index('if(BUILD')]
    assert check_package(package(edited('CMakeLists.txt', body, form))) == ()


@pytest.mark.parametrize('name', sorted({name.split('/')[0] for name in installed_names()}))
def test_no_false_alarm_on_an_installed_package(name, package):
    share = share_folder(name)
    manifest = parse_package(str(share))
    build = {depend.name for depend in (*manifest.build_depends, *manifest.buildtool_depends)}
    needed = sorted(build & {name.split('/')[0] for name in installed_names()})
    files = dict.fromkeys(FILES)
    for kind in ('msg', 'srv', 'action'):
        for file in share.glob(f'{kind}/*.{kind}'):
            files[f'{kind}/{file.name}'] = file.read_text(encoding='utf-8')
    listed = ' '.join(file for file, text in files.items() if text is not None)
    find = '\n'.join(f'find_package({package})' for package in sorted(build))
    files['package.xml'] = (share / 'package.xml').read_text(encoding='utf-8')
    # An installed package has no CMakeLists.txt.
    files['CMakeLists.txt'] = (
        f'project({name})\nfind_package(ament_cmake)\n{find}\nrosidl_generate_interfaces('
        f'${{PROJECT_NAME}} {listed} DEPENDENCIES {" ".join(needed)})\nament_package()'
    )
    assert check_package(package(files, name)) == ()


@pytest.mark.parametrize(
    ('path', 'error', 'words'),
    [('nowhere', ValueError, "no folder 'nowhere'"), (None, TypeError, 'a folder, not None')],
)
def test_bad_path(path, error, words):
    with pytest.raises(error, match=words):
        check_package(path)


PIECES = ['(', ')', '"', '${', '}', '<', '/>', '\\', '---', '\n', '\x00', 'é', '#', ';', '/', '']


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([*FILES]), st.floats(0, 1), st.integers(0, 9), st.sampled_from(PIECES)
        ),
        min_size=1,
        max_size=3,
    )
)
def test_a_damaged_package_gives_findings_and_no_traceback(package, damages):
    files = dict(FILES)
    for file, where, length, piece in damages:
        at = round(where * len(files[file]))
        files[file] = files[file][:at] + piece + files[file][at + length :]
    for finding in check_package(package(files)):
        assert all(isinstance(part, str) and part for part in finding)


# --- the reader ---

WORD = st.from_regex(r'[a-z]{1,6}', fullmatch=True)
WORDS = st.lists(WORD, max_size=3, unique=True)


@given(WORD, WORDS, WORDS, WORDS, st.data())
def test_what_is_written_is_read(project, found, files, dependencies, data):
    def blank():
        return data.draw(st.sampled_from([' ', '\n  ', '\t', ' # a ( "comment\n']))

    def write(command, *arguments):
        texts = [data.draw(st.sampled_from([word, f'"{word}"'])) for word in arguments]
        name = data.draw(st.sampled_from([command, command.upper()]))
        return f'{name} ({blank().join(["", *texts, ""])})\n'

    text = write('project', project)
    text += ''.join(write('find_package', name, 'REQUIRED') for name in found)
    if data.draw(st.booleans()):
        text += write('set', 'FILES', *files[:1]) + write('list', 'APPEND', 'FILES', *files[1:])
        listed = ['${FILES}']
    else:
        listed = files
    text += write(
        'rosidl_generate_interfaces', '${PROJECT_NAME}', *listed, 'DEPENDENCIES', *dependencies
    )
    text += write('find_package', 'late')
    read = CMakeLists(text)
    assert (read.project, read.found) == (project, set(found))
    assert (read.files, read.dependencies) == (files, dependencies)
    with pytest.raises(ValueError, match='parenthesis'):
        CMakeLists(re.sub(r'\)\s*$', '', text))
