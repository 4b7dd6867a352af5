"""The listings are compared with what the ros2 command prints, letter by letter."""

import random
import re
import sys
import time

import pytest
from rosidl_adapter import parser

from helpers import interfaces
from helpers.interfaces import check_package, dependencies, list_interfaces, needed_packages, show

INSTALLED = interfaces._names()

# From the tutorial (2024, Humble). The web page holds 8 columns for each tab.
TUTORIAL = """\
float32 deg_turn
---
sensor_msgs/Image camera_image
        std_msgs/Header header #
                builtin_interfaces/Time stamp
                        int32 sec
                        uint32 nanosec
                string frame_id
                                     # Header frame_id should be optical frame of camera
                                     # origin of frame should be optical center of cameara
                                     # +x should point to the right in the image
                                     # +y should point down in the image
                                     # +z should point into to plane of the image
                                     # If the frame_id here and the frame_id of the CameraInfo
                                     # message associated with the image conflict
                                     # the behavior is undefined
        uint32 height                #
        uint32 width                 #
        string encoding       #
                              # taken from the list of strings in include/sensor_msgs/image_encodings.hpp
        uint8 is_bigendian    #
        uint32 step           #
        uint8[] data          #
"""  # noqa: E501

TURN_CAMERA = 'float32 deg_turn\n---\nsensor_msgs/Image camera_image\n'

# A line of an interface, and what is left of it where comments are hidden (None: nothing).
CORNERS = [
    ('# a comment', None),
    ('#', '#'),
    ('# [m]', '# [m]'),
    ('', None),
    ('    ', None),
    ('  # an indented comment', '  # an indented comment'),
    ('int32 A=1 # one', 'int32 A=1 #'),
    ('int32 B=-2# two [s]', 'int32 B=-2#'),
    ('string NAME="a b"   # quoted', 'string NAME="a b"   #'),
    ('float32 angle            # of the scan [rad]', 'float32 angle            #'),
    ('float32 position # in [m] here', 'float32 position # in [m] he'),
    ('float32 speed # [m/s] of it', 'float32 speed # [m/s]'),
    ('string name # name', 'string'),
    ('uint8 empty #', 'uint8 empty #'),
    ('uint8 twice ## two # signs', 'uint8 twice ##'),
    ('string<=5 word "hello"', 'string<=5 word "hello"'),
    ('string<=5[<=2] words ["a", "b"]', 'string<=5[<=2] words ["a", "b"]'),
    ('uint8[3] three [1, 2, 3]', 'uint8[3] three [1, 2, 3]'),
    ('uint8[] many\t# after a tab', 'uint8[] many\t#'),
    ('uint8 tab # in\tside', 'uint8 tab # in\tsi'),
    ('wstring wide', 'wstring wide'),
    ('float64 last 1.5 # the default', 'float64 last 1.5 #'),
]


class Prefix:
    """A folder like those that colcon installs to, before the others in AMENT_PREFIX_PATH."""

    def __init__(self, path, monkeypatch):
        self.share = path / 'share'
        self.index = self.share / 'ament_index' / 'resource_index'
        for kind in ('packages', 'rosidl_interfaces'):
            (self.index / kind).mkdir(parents=True)
        monkeypatch.setenv('AMENT_PREFIX_PATH', str(path))

    def add(self, name, text):
        package, kind, short = name.split('/')
        file = self.share / package / kind / f'{short}.{kind}'
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding='utf-8')
        (self.index / 'packages' / package).touch()
        with (self.index / 'rosidl_interfaces' / package).open('a') as index:
            index.write(f'{kind}/{short}.idl\n{kind}/{short}.{kind}\n')


@pytest.fixture
def prefix(tmp_path, monkeypatch):
    return Prefix(tmp_path / 'install', monkeypatch)


@pytest.fixture
def listing(capsys):
    def listing(name, comments='default'):
        capsys.readouterr()
        show(name, comments)
        return capsys.readouterr().out

    return listing


# --- show ---


def test_the_listing_of_the_tutorial(prefix, listing):
    prefix.add('custom_interfaces/srv/TurnCamera', TURN_CAMERA)
    text = listing('custom_interfaces/srv/TurnCamera')
    assert text.expandtabs(8) == TUTORIAL
    assert (
        '\n\tstd_msgs/Header header #\n\t\tbuiltin_interfaces/Time stamp\n\t\t\tint32 sec\n' in text
    )


@pytest.mark.parametrize(('line', 'bare'), CORNERS)
def test_a_line_in_all_modes(prefix, listing, line, bare):
    prefix.add('corner_msgs/msg/Inner', f'{line}\nbool end')
    prefix.add('corner_msgs/msg/Outer', 'Inner inner # here\n')
    lines = {mode: listing('corner_msgs/msg/Inner', mode).splitlines() for mode in ('all', 'none')}
    assert (
        lines['all'] == listing('corner_msgs/msg/Inner').splitlines() == [line.rstrip(), 'bool end']
    )
    assert lines['none'] == [text for text in (bare, 'bool end') if text is not None]
    below = [f'\t{text}' for text in lines['none']]
    assert listing('corner_msgs/msg/Outer').splitlines() == ['Inner inner # here', *below]
    assert listing('corner_msgs/msg/Outer', 'none').splitlines() == ['Inner inner #', *below]
    below = [f'\t{text}' if text else '' for text in lines['all']]
    assert listing('corner_msgs/msg/Outer', 'all').splitlines() == ['Inner inner # here', *below]


def test_an_action_with_messages_of_its_own_package_in_arrays(prefix, listing):
    prefix.add('corner_msgs/msg/Step', '# A step\nuint8 LAST=9 # end\nfloat32 angle 0.5 # in rad\n')
    prefix.add(
        'corner_msgs/action/Turn',
        'Step[2] steps # two\n\n--- \ncorner_msgs/Step[<=3] done\n---\n# feedback\nfloat32 left',
    )
    steps = '\tuint8 LAST=9 #\n\tfloat32 angle 0.5 #\n'
    assert listing('corner_msgs/action/Turn') == (
        f'Step[2] steps # two\n{steps}\n---\ncorner_msgs/Step[<=3] done\n{steps}'
        '---\n# feedback\nfloat32 left\n'
    )
    assert listing('corner_msgs/action/Turn', 'none') == (
        f'Step[2] steps #\n{steps}---\ncorner_msgs/Step[<=3] done\n{steps}---\nfloat32 left\n'
    )


def test_installed_interfaces_literally(listing):
    assert listing('std_msgs/msg/String', 'none') == 'string data\n'
    assert listing('std_srvs/srv/Empty', 'all') == '---\n'
    assert listing('std_srvs/srv/Empty', 'none') == '---\n'
    assert listing('std_srvs/srv/SetBool') == (
        'bool data # e.g. for hardware enabling / disabling\n---\n'
        'bool success   # indicate successful run of triggered service\n'
        'string message # informational, e.g. for error messages\n'
    )
    assert listing('std_srvs/srv/SetBool', 'none') == (
        'bool data #\n---\nbool success   #\nstring message #\n'
    )
    assert listing('geometry_msgs/msg/Pose') == (
        '# A representation of pose in free space, composed of position and orientation.\n\n'
        'Point position\n\tfloat64 x\n\tfloat64 y\n\tfloat64 z\n'
        'Quaternion orientation\n\tfloat64 x 0\n\tfloat64 y 0\n\tfloat64 z 0\n\tfloat64 w 1\n'
    )
    assert listing('unique_identifier_msgs/msg/UUID', 'none') == '#\nuint8[16] uuid\n'


def is_part(short, long):
    rest = iter(long)
    return all(line in rest for line in short)


def fields_of(listing):
    """The (depth, type, name) of each field of a listing, read by the parser line by line."""
    for line in listing.splitlines():
        text = line.lstrip('\t')
        if not text or text == '---':
            continue
        for field in parser.parse_message_string('pkg', 'Line', text).fields:
            name = parser.BaseType.__str__(field.type).rpartition('/')[2]
            yield len(line) - len(text), name, field.name


@pytest.mark.parametrize('package', sorted({name.split('/')[0] for name in INSTALLED}))
def test_each_installed_interface_is_consistent(package, listing):
    for name in INSTALLED:
        if not name.startswith(f'{package}/'):
            continue
        file = interfaces._find(name)
        kind = name.split('/')[1]
        assert file.suffix == f'.{kind}'
        own = [line.rstrip() for line in file.read_text(encoding='utf-8').splitlines()]
        listings = {mode: listing(name, mode) for mode in interfaces.COMMENTS}
        lines = {mode: text.splitlines() for mode, text in listings.items()}
        # The file itself is there, line by line, but for the nested messages between its lines.
        assert is_part(own, lines['default'])
        assert is_part(own, lines['all'])
        nested = [line for line in lines['default'] if line.startswith('\t')]
        assert nested == [line for line in lines['none'] if line.startswith('\t')]
        assert len(lines['default']) == len(own) + len(nested)
        assert '' not in lines['none']
        assert len(lines['none']) <= len(lines['default']) <= len(lines['all'])
        # Every mode shows the fields that the whole file has, in their order and depth.
        table = dependencies(name)
        top = 1 if kind == 'msg' else 2
        rows = table[table.depth >= top]
        tree = [(r.depth - top, r.type.rpartition('/')[2], r.field) for r in rows.itertuples()]
        # Where a comment repeats the field's text, the command cuts the field: no such interface.
        for text in listings.values():
            assert list(fields_of(text)) == tree
        assert '\n'.join(lines['none']).count('---') >= {'msg': 0, 'srv': 1, 'action': 2}[kind]


def test_all_installed_interfaces_are_shown_within_two_seconds(listing):
    interfaces._read_line.cache_clear()
    started = time.perf_counter()
    for name in INSTALLED:
        listing(name)
    assert time.perf_counter() - started < 2
    assert len(INSTALLED) > 150


def test_an_interface_that_is_only_idl_is_printed_as_it_is(prefix, listing):
    prefix.add('idl_msgs/msg/Some', '')
    file = prefix.share / 'idl_msgs' / 'msg' / 'Some.msg'
    file.unlink()
    file.with_suffix('.idl').write_text('module idl_msgs {\n  // IDL\n};\n')
    assert listing('idl_msgs/msg/Some') == 'module idl_msgs {\n  // IDL\n};\n'
    with pytest.raises(ValueError, match='exists only as .idl'):
        dependencies('idl_msgs/msg/Some')


def test_an_overlay_wins_and_a_change_is_seen(prefix, listing):
    prefix.add('std_msgs/msg/String', 'string data # changed\n')
    assert listing('std_msgs/msg/String') == 'string data # changed\n'
    (prefix.share / 'std_msgs/msg/String.msg').write_text('string other\n')
    assert listing('std_msgs/msg/String') == 'string other\n'


@pytest.mark.parametrize(
    ('name', 'error', 'words'),
    [
        ('sensor_msgs/Image', ValueError, 'nearest: sensor_msgs/msg/Image'),
        ('Image', ValueError, 'nearest: sensor_msgs/msg/Image'),
        ('sensor_msgs/srv/Image', ValueError, 'nearest: sensor_msgs/msg/Image'),
        ('sensor_msgs/msg/image', ValueError, 'nearest: sensor_msgs/msg/Image'),
        ('sensor_msg/msg/Imagge', ValueError, 'sensor_msgs/msg/Image'),
        ('custom_interfaces/msg/Twist', ValueError, 'nearest: geometry_msgs/msg/Twist'),
        ('std_msgs/msg/../msg/String', ValueError, 'no interface'),
        ('qqq', ValueError, r'list_interfaces\(\) prints all names'),
        ('', ValueError, r'list_interfaces\(\) prints all names'),
        (3, TypeError, 'has a name such as'),
        (None, TypeError, 'has a name such as'),
    ],
)
def test_a_wrong_name_gets_one_sentence_with_the_nearest(name, error, words):
    for function in (show, dependencies, needed_packages):
        with pytest.raises(error, match=words) as caught:
            function(name)
        assert '\n' not in str(caught.value)


def test_wrong_comments():
    with pytest.raises(ValueError, match='comments must be one of default, all, none'):
        show('std_msgs/msg/String', comments=True)


def test_nothing_installed(tmp_path, monkeypatch):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    with pytest.raises(ValueError, match='No interface is installed here'):
        show('std_msgs/msg/String')


# --- list and dependencies ---


def test_list_interfaces(prefix, capsys):
    prefix.add('custom_interfaces/srv/TurnCamera', TURN_CAMERA)
    prefix.add('custom_interfaces/srv/TurnCamera_Request', 'float32 deg_turn')
    prefix.add('custom_interfaces/action/Turn', '---\n---\n')
    list_interfaces()
    lines = capsys.readouterr().out.splitlines()
    heads = [lines.index(head) for head in ('Messages:', 'Services:', 'Actions:')]
    assert heads[0] == 0
    assert heads == sorted(heads)
    messages, services = lines[1 : heads[1]], lines[heads[1] + 1 : heads[2]]
    actions = lines[heads[2] + 1 :]
    assert messages == sorted(messages)
    assert '    sensor_msgs/msg/Image' in messages
    assert '    custom_interfaces/srv/TurnCamera' in services
    assert actions == ['    custom_interfaces/action/Turn']
    assert not [line for line in lines if 'TurnCamera_Request' in line]
    assert len(lines) == len(interfaces._names()) + 3 == len(set(lines))
    list_interfaces('custom')
    assert capsys.readouterr().out == (
        '    custom_interfaces/srv/TurnCamera\n    custom_interfaces/action/Turn\n'
    )
    with pytest.raises(TypeError, match='containing must be a text'):
        list_interfaces(None)


def test_dependencies_of_the_tutorial(prefix):
    prefix.add('custom_interfaces/srv/TurnCamera', TURN_CAMERA)
    table = dependencies('custom_interfaces/srv/TurnCamera')
    own = 'custom_interfaces'
    assert list(table.itertuples(index=False, name=None))[:9] == [
        (0, 'TurnCamera', f'{own}/srv/TurnCamera', own, ''),
        (1, 'request', f'{own}/srv/TurnCamera_Request', own, ''),
        (2, 'deg_turn', 'float32', '', ''),
        (1, 'response', f'{own}/srv/TurnCamera_Response', own, ''),
        (2, 'camera_image', 'sensor_msgs/msg/Image', 'sensor_msgs', ''),
        (3, 'header', 'std_msgs/msg/Header', 'std_msgs', ''),
        (4, 'stamp', 'builtin_interfaces/msg/Time', 'builtin_interfaces', ''),
        (5, 'sec', 'int32', '', ''),
        (5, 'nanosec', 'uint32', '', ''),
    ]
    assert table.iloc[-1].tolist() == [3, 'data', 'uint8', '', '[]']
    assert needed_packages('custom_interfaces/srv/TurnCamera') == ['sensor_msgs']


def test_needed_packages_are_also_those_of_own_messages(prefix):
    prefix.add('own_msgs/msg/Inner', 'geometry_msgs/Pose[<=2] poses\nstring<=4 s\n')
    prefix.add('own_msgs/action/Outer', 'Inner inner\n---\nnav_msgs/Path path\n---\nuint8[3] x\n')
    assert needed_packages('own_msgs/action/Outer') == ['geometry_msgs', 'nav_msgs']
    table = dependencies('own_msgs/action/Outer')
    assert table[table.depth == 1].field.tolist() == ['goal', 'result', 'feedback']
    assert table[table.field == 'poses'].array.tolist()[0] == '[<=2]'
    assert table[table.field == 's'].type.tolist() == ['string<=4']
    assert table.iloc[-1].array == '[3]'
    assert needed_packages('std_msgs/msg/String') == []


# --- check_package ---

CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(custom_interfaces)

if(CMAKE_COMPILER_IS_GNUCXX OR CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  add_compile_options(-Wall -Wextra -Wpedantic)
endif()

# find dependencies
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(sensor_msgs REQUIRED) # Add packages that the custom interfaces depend on

rosidl_generate_interfaces(${PROJECT_NAME}
  "srv/TurnCamera.srv"
  DEPENDENCIES sensor_msgs # Add packages that the custom interfaces depend on
)

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
FILES = {'CMakeLists.txt': CMAKE, 'package.xml': MANIFEST, 'srv/TurnCamera.srv': TURN_CAMERA}

# A line that may be left out, what check_package then asks for, and what Jazzy answered, or did.
OMISSIONS = {
    'cmake_minimum_required(VERSION 3.8)': (
        'cmake_minimum_required(',
        'No cmake_minimum_required command is present',
    ),
    'project(custom_interfaces)': ('project(custom_interfaces)', 'InvalidResourceName'),
    'if(CMAKE_COMPILER_IS_GNUCXX': ('if(...) before endif() of line 5', 'not properly nested'),
    'endif()': ('endif() for if() of line 4', 'not properly nested'),
    'find_package(ament_cmake': ('find_package(ament_cmake REQUIRED)', 'it builds'),
    'find_package(rosidl_default_generators': (
        'find_package(rosidl_default_generators REQUIRED)',
        'Unknown CMake command "rosidl_generate_interfaces"',
    ),
    'find_package(sensor_msgs': (
        'find_package(sensor_msgs REQUIRED)',
        "the passed dependency 'sensor_msgs' has not been found before using find_package()",
    ),
    'rosidl_generate_interfaces(': ('rosidl_generate_interfaces(', 'Expected a command name'),
    '  "srv/TurnCamera.srv"': ('"srv/TurnCamera.srv"', 'called without any interface files'),
    '  DEPENDENCIES sensor_msgs': ('DEPENDENCIES sensor_msgs', "KeyError: 'sensor_msgs'"),
    ')': ("')' that closes rosidl_generate_interfaces(", 'Function missing ending ")"'),
    'ament_package()': ('ament_package()', 'not found: .../local_setup.bash'),
    '<package': ('<package>', 'invalid XML: junk after document element'),
    '  <name>': ('<name>', 'must contain exactly one "name" tag'),
    '  <version>': ('<version>', 'must contain exactly one "version" tag'),
    '  <description>': ('<description>', 'must contain exactly one "description" tag'),
    '  <maintainer': ('<maintainer>', 'must declare at least one maintainer'),
    '  <license>': ('<license>', 'must contain at least one "license" tag'),
    '  <buildtool_depend>ament': ('<buildtool_depend>ament_cmake<', 'ament_cmakeConfig.cmake'),
    '  <buildtool_depend>rosidl': (
        '<buildtool_depend>rosidl_default_generators<',
        'rosidl_default_generatorsConfig.cmake',
    ),
    '  <depend>': ('<depend>sensor_msgs</depend>', 'sensor_msgsConfig.cmake'),
    '  <exec_depend>': ('<exec_depend>rosidl_default_runtime</exec_depend>', 'it builds'),
    '  <member_of_group>': (
        '<member_of_group>rosidl_interface_packages</member_of_group>',
        'Packages installing interfaces must include',
    ),
    '  <export>': ('<export>', 'invalid XML: mismatched tag'),
    '    <build_type>': ('<build_type>ament_cmake</build_type>', "colcon builds it as 'catkin'"),
    '  </export>': ('</export>', 'invalid XML: mismatched tag'),
    '</package>': ('</package>', 'invalid XML: no element found'),
}
HARMLESS = ('#', '<?xml', '  add_compile_options')


@pytest.fixture
def package(tmp_path):
    """Write a package: the tutorial's, with the given files instead. None removes a file."""

    def package(files=None, replace=(), folder='custom_interfaces'):
        root = tmp_path / 'src' / folder
        for file, text in {**FILES, **(files or {})}.items():
            path = root / file
            if text is None:
                path.unlink(missing_ok=True)
                continue
            for old, new in replace:
                text = text.replace(old, new)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        return root

    return package


def test_the_tutorials_package_lacks_nothing(package):
    findings = check_package(package())
    assert findings == ()
    assert repr(findings) == '[ok] Nothing is missing.'


def each_line():
    for file in ('CMakeLists.txt', 'package.xml'):
        for number, line in enumerate(FILES[file].splitlines()):
            if line.strip():
                yield pytest.param(file, number, line, id=f'{file} {line.strip()}')


@pytest.mark.parametrize(('file', 'number', 'line'), list(each_line()))
def test_each_line_that_is_left_out_is_named(package, file, number, line):
    lines = FILES[file].splitlines(keepends=True)
    findings = check_package(package({file: ''.join(lines[:number] + lines[number + 1 :])}))
    if line.startswith(HARMLESS):
        assert findings == ()
        return
    (finding,) = findings
    missing, error = max(
        (item for item in OMISSIONS.items() if line.startswith(item[0])), key=lambda i: len(i[0])
    )[1]
    assert finding.file == file
    assert missing in finding.missing
    assert error in finding.error
    assert repr(findings).startswith(f'[missing] {file}: ')


def test_both_lines_of_a_dependency(package):
    text = CMAKE.replace('find_package(sensor_msgs REQUIRED)', '')
    findings = check_package(package({'CMakeLists.txt': re.sub('DEPENDENCIES.*', '', text)}))
    assert [f.missing.split(',')[0].split(' in ')[0] for f in findings] == [
        'DEPENDENCIES sensor_msgs',
        'find_package(sensor_msgs REQUIRED)',
    ]


TOO_EARLY = CMAKE.replace('ament_package()', '').replace(
    'rosidl_generate_', 'ament_package()\nrosidl_generate_'
)
ACTION = 'Goal goal\n---\ngeometry_msgs/Pose[] poses\n---\nfloat32 left\n'


@pytest.mark.parametrize(
    ('files', 'where', 'missing', 'error'),
    [
        ({'package.xml': None}, 'package.xml', 'the file', 'colcon'),
        ({'CMakeLists.txt': None}, 'CMakeLists.txt', 'the file', 'does not appear to contain'),
        ({'srv/TurnCamera.srv': None}, 'srv/TurnCamera.srv', 'line 13', "doesn't exist"),
        (
            {'srv/TurnCamera.srv': 'float32 a\n--\nsensor_msgs/Image b\n'},
            'srv/TurnCamera.srv', 'exactly ---', "Could not find separator '---'",
        ),
        (
            {'srv/TurnCamera.srv': 'float32 a\n---\nsensor_msgs/Image b\n---\n'},
            'srv/TurnCamera.srv', 'exactly ---', 'Could not find unique separator',
        ),
        (
            {'srv/TurnCamera.srv': 'float32 a\n---\nImage b\n'},
            'srv/TurnCamera.srv', 'for example sensor_msgs/Image',
            "FileNotFoundError: [Errno 2] No such file or directory: "
            "'.../custom_interfaces/msg/Image.json'",
        ),
        (
            {'srv/TurnCamera.srv': 'float32 a\n---\nsensor_msgs/Imagee b\n'},
            'srv/TurnCamera.srv', 'The nearest is sensor_msgs/Image', 'Imagee.json',
        ),
        (
            {'srv/TurnCamera.srv': 'float32 a\n---\nsensor_msg/Image b\n'},
            'srv/TurnCamera.srv', 'the package sensor_msg, which is neither installed nor in this '
            'workspace. Is it sensor_msgs?', 'sensor_msgConfig.cmake',
        ),
        (
            {'srv/TurnCamera.srv': 'float32 a\n---\nsensor_msgs/msg/Image b\n'},
            'srv/TurnCamera.srv', 'has no /msg/', 'InvalidResourceName: sensor_msgs/msg/Image',
        ),
        (
            {'srv/TurnCamera.srv': 'float32 degTurn\n---\nsensor_msgs/Image b\n'},
            'srv/TurnCamera.srv', 'a field name', "NameError: 'degTurn' is an invalid field name",
        ),
        (
            {'srv/More.srv': '---\n'},
            'CMakeLists.txt', '"srv/More.srv"', 'it builds, but without this interface',
        ),
        (
            {'CMakeLists.txt': CMAKE.replace('custom_interfaces)', 'other)')},
            'CMakeLists.txt', 'project(custom_interfaces)',
            "does not match the current PROJECT_NAME 'other'",
        ),
        (
            {'CMakeLists.txt': TOO_EARLY},
            'CMakeLists.txt', 'ament_package() after', 'must be called before ament_package()',
        ),
        (
            {'CMakeLists.txt': re.sub(r'rosidl_generate.*?\n\)', '', CMAKE, flags=re.DOTALL)},
            'CMakeLists.txt', 'rosidl_generate_interfaces(', 'without any interface',
        ),
        (
            {
                'CMakeLists.txt': CMAKE.replace('srv/Turn', 'camera/Turn'),
                'camera/TurnCamera.srv': TURN_CAMERA, 'srv/TurnCamera.srv': None,
            },
            'camera/TurnCamera.srv', 'srv/TurnCamera.srv', 'does not show it',
        ),
        (
            {
                'CMakeLists.txt': CMAKE.replace('srv/Turn', 'Turn'),
                'TurnCamera.srv': TURN_CAMERA, 'srv/TurnCamera.srv': None,
            },
            'TurnCamera.srv', 'srv/TurnCamera.srv', 'incorrect number of arguments',
        ),
    ],
)  # fmt: skip
def test_other_mistakes(package, files, where, missing, error):
    findings = check_package(package(files))
    found = [f for f in findings if f.file == where and missing in f.missing and error in f.error]
    assert len(found) == 1, repr(findings)


@pytest.mark.parametrize(
    ('kind', 'text'),
    [('msg', 'bool on'), ('srv', TURN_CAMERA), ('action', 'bool on\n---\n---\n')],
)
def test_a_name_that_is_not_camel_case(package, kind, text):
    file = f'{kind}/turn_camera.{kind}'
    files = {'srv/TurnCamera.srv': None, file: text}
    root = package(files, replace=[('srv/TurnCamera.srv', file)])
    (finding,) = check_package(root)
    assert finding.file == file
    # What the build prints, from the parser that the build calls.
    with pytest.raises(interfaces.parser.InvalidResourceName) as failure:
        interfaces._parse('custom_interfaces', root / file)
    assert f'{finding.error}.' == f'InvalidResourceName: {failure.value}'.split(' It should')[0]


@pytest.mark.parametrize(
    ('line', 'missing'),
    [
        ('float deg_turn', 'a type that exists, float32 or float64, in place of float'),
        ('int deg_turn', 'a type that exists, int32 or int64, in place of int'),
        (
            'sensor_msgs/msg/Image deg_turn',
            'sensor_msgs/Image in place of sensor_msgs/msg/Image: in a definition a type has no '
            '/msg/',
        ),
        ('float32 degTurn', 'a field name in lower case with underscores, such as deg_turn'),
        ('float32', 'a definition that rosidl can read'),
    ],
)
def test_a_line_that_rosidl_cannot_read(package, line, missing):
    root = package({'srv/TurnCamera.srv': TURN_CAMERA.replace('float32 deg_turn', line)})
    finding = next(f for f in check_package(root) if f.file == 'srv/TurnCamera.srv')
    assert finding.missing == missing


def test_commas_after_dependencies(package):
    text = CMAKE.replace('DEPENDENCIES sensor_msgs', 'DEPENDENCIES sensor_msgs, std_msgs')
    text = text.replace('find_package(sen', 'find_package(std_msgs REQUIRED)\nfind_package(sen')
    xml = FILES['package.xml'].replace('<depend>s', '<depend>std_msgs</depend>\n<depend>s')
    (finding,) = check_package(package({'CMakeLists.txt': text, 'package.xml': xml}))
    assert finding.missing == 'blanks in place of commas after DEPENDENCIES: sensor_msgs,'


def test_findings_fit_on_a_slide(package):
    shown = repr(check_package(package({'package.xml': None, 'CMakeLists.txt': None})))
    assert max(map(len, shown.splitlines())) <= 94
    assert shown.splitlines()[1].startswith('          Without it: ')


def test_a_find_package_that_comes_too_late(package):
    line = 'find_package(sensor_msgs REQUIRED)'
    text = CMAKE.replace(line, '').replace('ament_package()', f'{line}\nament_package()')
    (finding,) = check_package(package({'CMakeLists.txt': text}))
    assert finding.missing == f'{line}, before rosidl_generate_interfaces()'


# Forms that packages of other people have.
FORMS = {
    'variables': """
        set(srvs "srv/TurnCamera.srv")
        set(needed
          sensor_msgs)
        foreach(package ${needed})
          find_package(${package} REQUIRED)
        endforeach()
        ROSIDL_GENERATE_INTERFACES(${PROJECT_NAME} ${srvs} DEPENDENCIES ${needed} ADD_LINTER_TESTS)
        """,
    'append': """
        find_package(sensor_msgs REQUIRED)
        set(srvs)
        list(APPEND srvs srv/TurnCamera.srv)
        rosidl_generate_interfaces(custom_interfaces DEPENDENCIES "sensor_msgs" LIBRARY_NAME turn
          SKIP_INSTALL ${srvs})
        """,
    'glob': """
        find_package(sensor_msgs)
        set(srvs)
        file(GLOB srvs RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} "srv/*.srv")
        rosidl_generate_interfaces(${PROJECT_NAME} ${srvs} DEPENDENCIES sensor_msgs)
        """,
    'tuple': """
        find_package(sensor_msgs REQUIRED)
        rosidl_generate_interfaces(${PROJECT_NAME} "${CMAKE_CURRENT_SOURCE_DIR}:srv/TurnCamera.srv"
          DEPENDENCIES sensor_msgs)
        """,
    'comments': """
        #[[ a comment ) of
        some lines ( ]] find_package(sensor_msgs REQUIRED) # and ( more
        set(text [=[ a ) "bracket ]=] "a quote \\" with ( and # in it")
        rosidl_generate_interfaces(${PROJECT_NAME} # the name
          srv/TurnCamera.srv # a file
          DEPENDENCIES
            sensor_msgs)
        """,
    'more than needed': """
        find_package(geometry_msgs REQUIRED)
        find_package(sensor_msgs REQUIRED)
        find_package(${OTHER} QUIET)
        rosidl_generate_interfaces(${PROJECT_NAME} "srv/TurnCamera.srv"
          DEPENDENCIES std_msgs sensor_msgs)
        if(BUILD_TESTING)
          find_package(ament_lint_auto REQUIRED)
          ament_lint_auto_find_test_dependencies()
        elseif(NOT X AND (Y OR Z))
          message(STATUS "$ENV{HOME} $<BUILD_INTERFACE:x>")
        else()
        endif()
        install(FILES rule.yaml DESTINATION share/${PROJECT_NAME})
        """,
}


def cmake_with(body, find='find_package(ament_cmake)', last='ament_package()'):
    generators = '' if 'auto' in find else 'find_package(rosidl_default_generators REQUIRED)'
    head = f'CMAKE_MINIMUM_REQUIRED(VERSION 3.5)\nproject(custom_interfaces NONE)\n{find}\n'
    return f'{head}{generators}\n{body}\n{last}\n'


@pytest.mark.parametrize('form', FORMS)
def test_no_false_alarm_on_other_forms(package, form):
    manifest = MANIFEST.replace('<depend>', '<depend>std_msgs</depend><depend>', 1)
    files = {'CMakeLists.txt': cmake_with(FORMS[form]), 'package.xml': manifest}
    assert check_package(package(files)) == ()


def test_no_false_alarm_on_ament_cmake_auto(package):
    text = cmake_with(
        'rosidl_generate_interfaces(${PROJECT_NAME} srv/TurnCamera.srv DEPENDENCIES sensor_msgs)',
        'find_package(ament_cmake_auto REQUIRED)\nament_auto_find_build_dependencies()',
        'ament_auto_package()',
    )
    assert check_package(package({'CMakeLists.txt': text})) == ()
    manifest = MANIFEST.replace('  <depend>sensor_msgs</depend>\n', '')
    findings = check_package(package({'CMakeLists.txt': text, 'package.xml': manifest}))
    assert {f.file for f in findings} == {'CMakeLists.txt', 'package.xml'}


def test_what_a_dependency_brings_is_not_asked_for(package):
    # service_msgs brings builtin_interfaces to each service, and sensor_msgs brings std_msgs.
    srv = 'builtin_interfaces/Time at\nstd_msgs/Header header\n---\nsensor_msgs/Image image\n'
    assert check_package(package({'srv/TurnCamera.srv': srv})) == ()


def test_a_package_beside_it_counts_as_present(package):
    package(replace=[('custom_interfaces', 'camera_interfaces')], folder='camera_interfaces')
    root = package(
        {'msg/Shot.msg': 'int8 x\n', 'srv/TurnCamera.srv': '---\ncamera_interfaces/Shot shot\n'},
        replace=[
            ('sensor_msgs', 'camera_interfaces'),
            ('"srv/TurnCamera.srv"', '"srv/TurnCamera.srv" "msg/Shot.msg"'),
        ],
    )
    (finding,) = check_package(root)
    assert 'camera_interfaces has no Shot' in finding.missing
    shot = root.parent / 'camera_interfaces' / 'msg' / 'Shot.msg'
    shot.parent.mkdir()
    shot.write_text('int8 x\n')
    assert check_package(root) == ()


def test_an_action_with_two_packages_and_an_own_message(package):
    files = {'action/Turn.action': ACTION, 'msg/Goal.msg': 'std_msgs/Header[<=2] headers\n'}
    listed = [('"srv/TurnCamera.srv"', '"srv/TurnCamera.srv" msg/Goal.msg action/Turn.action')]
    assert check_package(package(files, replace=listed)) == ()  # sensor_msgs brings both
    less = [*listed, ('sensor_msgs', 'std_msgs')]
    files['srv/TurnCamera.srv'] = '---\nbool ok'
    findings = check_package(package(files, replace=less))
    assert [f.file for f in findings] == ['CMakeLists.txt', 'CMakeLists.txt', 'package.xml']
    assert all('geometry_msgs' in f.missing for f in findings)


def source_of(name, root):
    """The source package of an installed one. Its CMakeLists.txt is not installed: write it."""
    share = interfaces._share(name)
    kinds = [f for f in share.glob('*/*') if f.parent.name in interfaces.KINDS]
    kinds = [f for f in kinds if f.suffix == f'.{f.parent.name}']
    for file in [share / 'package.xml', *kinds]:
        target = root / file.relative_to(share)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(file.read_bytes())
    manifest = interfaces._manifest(share / 'package.xml')
    needed = sorted(
        interfaces._depends(manifest, 'build') & interfaces._interface_packages().keys()
    )
    generators = [
        p for p in interfaces.GENERATORS if p in interfaces._depends(manifest, 'buildtool', 'build')
    ]
    lines = ['cmake_minimum_required(VERSION 3.8)', f'project({name})', 'find_package(ament_cmake)']
    lines += [f'find_package({package} REQUIRED)' for package in [*generators, *needed]]
    lines += ['rosidl_generate_interfaces(${PROJECT_NAME}']
    lines += [f'  "{file.relative_to(share)}"' for file in kinds]
    lines += [f'  DEPENDENCIES {" ".join(needed)}' if needed else '', ')', 'ament_package()']
    (root / 'CMakeLists.txt').write_text('\n'.join(lines))
    return root


@pytest.mark.parametrize('name', sorted(interfaces._interface_packages()))
def test_no_false_alarm_on_an_installed_package(name, tmp_path):
    assert check_package(source_of(name, tmp_path / name)) == ()


@pytest.mark.parametrize(
    ('path', 'error', 'words'),
    [
        ('nowhere', ValueError, 'no folder'),
        (3, TypeError, 'a folder'),
        (None, TypeError, 'a folder'),
    ],
)
def test_bad_path(path, error, words):
    with pytest.raises(error, match=words):
        check_package(path)


def test_a_python_package_is_refused(package):
    manifest = MANIFEST.replace('>ament_cmake</build_type', '>ament_python</build_type')
    root = package({'CMakeLists.txt': None, 'package.xml': manifest})
    assert [f.file for f in check_package(root)] == ['package.xml', 'CMakeLists.txt'][::-1]
    (root / 'srv' / 'TurnCamera.srv').unlink()
    with pytest.raises(ValueError, match='only CMake ones have interfaces'):
        check_package(root)


def test_a_damaged_package_gives_findings_and_never_a_traceback(package):
    dice = random.Random(0)
    parts = [
        '(',
        ')',
        '"',
        '${',
        '}',
        '[[',
        '<',
        '/>',
        '\\',
        '---',
        '\n',
        '\x00',
        'é',
        '#',
        ';',
        '=',
    ]
    texts = dict(FILES, **{'action/Turn.action': ACTION, 'msg/Goal.msg': 'int8[<=3] x [1]\n'})
    told = 0
    for _ in range(400):
        files = dict(texts)
        for _ in range(dice.randint(1, 3)):
            name = dice.choice(list(files))
            text = files[name]
            start = dice.randrange(len(text) + 1)
            end = start + dice.choice([0, 1, 2, 10])
            files[name] = text[:start] + dice.choice([*parts, '']) + text[end:]
        findings = check_package(package(files))
        told += bool(findings)
        assert all(isinstance(part, str) and part for finding in findings for part in finding)
    assert told > 100
