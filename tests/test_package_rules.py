"""A good package lacks nothing; with one edit, it lacks one thing, and the answer is Jazzy's."""

import pytest
from catkin_pkg.package import parse_package

from helpers.cmake_lists import read_cmake_lists
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


# What is taken out, what check_package then asks for, and what Jazzy answered, or did.
WITHOUT = [
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
    ('---', '--', 'one line that is exactly ---, between request and response',
     'InvalidServiceSpecification: Could not find separator'),
    ('---', '---\n---', 'one line that is exactly ---, between request and response',
     'Could not find unique separator'),
    ('sensor_msgs/Image', 'Image', "the package of the type Image of 'camera_image', for example "
     'sensor_msgs/Image', "FileNotFoundError: [Errno 2] No such file or directory: "
     "'.../custom_interfaces/msg/Image.json'"),
    ('sensor_msgs/Image', 'Q', "the package of the type Q of 'camera_image'", "msg/Q.json'"),
    ('s/Image', 's/msg/Image', 'sensor_msgs/Image in place of sensor_msgs/msg/Image: in a '
     'definition a type has no /msg/', 'InvalidResourceName: sensor_msgs/msg/Image'),
    ('float32', 'float', 'a type that exists, float32 or float64, in place of float', "'float'"),
    ('float32', 'int', 'a type that exists, int32 or int64, in place of int', "'int'"),
    ('deg_turn', 'degTurn', 'a definition that rosidl can read', "NameError: 'degTurn' is an inv"),
]  # fmt: skip


@pytest.mark.parametrize(('old', 'new', 'missing', 'error'), DEFINITIONS)
def test_a_definition_with_a_mistake(package, old, new, missing, error, capsys):
    ((file, what, answer),) = check_package(package(edited('srv/TurnCamera.srv', old, new)))
    assert capsys.readouterr() == ('', '')  # the parser itself prints
    assert file == 'srv/TurnCamera.srv'
    assert what == missing
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


def test_what_comes_with_others_is_not_asked_for(package):
    # service_msgs brings builtin_interfaces to each service, and sensor_msgs brings std_msgs.
    srv = 'std_msgs/Header header\n---\nsensor_msgs/Image image\n'
    assert check_package(package({'srv/TurnCamera.srv': srv})) == ()
    files = {'srv/TurnCamera.srv': '---\nbuiltin_interfaces/Time at\n'}
    files |= edited('CMakeLists.txt', 'DEPENDENCIES sensor_msgs')
    assert check_package(package(files)) == ()


def test_needed_to_build_and_to_use(package):
    both = '<build_depend>sensor_msgs</build_depend><exec_depend>sensor_msgs</exec_depend>'
    files = edited('package.xml', '<depend>sensor_msgs</depend>', both)
    assert check_package(package(files)) == ()
    build = '<build_depend>sensor_msgs</build_depend>'
    files = edited('package.xml', '<depend>sensor_msgs</depend>', build)
    [finding] = check_package(package(files))
    assert finding.missing == '<depend>sensor_msgs</depend>'


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


def test_a_folder_that_is_not_there():
    with pytest.raises(ValueError, match="There is no folder 'nowhere'. Give the folder with"):
        check_package('nowhere')


def test_how_a_file_may_be_written():
    read = read_cmake_lists("""
        # a ( and a " in a comment
        FIND_PACKAGE (one REQUIRED)
        message(STATUS "a \\" and a ) in quotes # no comment")
        if(BUILD_TESTING AND (NOT OFF))
        endif()
        Rosidl_Generate_Interfaces(${PROJECT_NAME} # the first ) of two
          "msg/A.msg";srv/B.srv
          DEPENDENCIES\tone "two"  # and
          three)
        find_package(late)
    """)
    assert read.commands >= {'find_package', 'message', 'endif', 'rosidl_generate_interfaces'}
    assert read.found == {'one'}
    assert read.files == ['msg/A.msg', 'srv/B.srv']
    assert read.dependencies == ['one', 'two', 'three']
    assert read_cmake_lists('rosidl_generate_interfaces(x a.msg)').files == ['a.msg']


def test_variables_of_set_are_followed():
    read = read_cmake_lists("""
        set(services "srv/A.srv" srv/B.srv)
        set(needed one)
        rosidl_generate_interfaces(${PROJECT_NAME} ${services} "${unknown}"
          DEPENDENCIES ${needed} two)
    """)
    assert read.files == ['srv/A.srv', 'srv/B.srv', '${unknown}']
    assert read.dependencies == ['one', 'two']
