"""The listings are compared with what the ros2 command prints, letter by letter."""

import pytest
from rosidl_adapter import parser

from helpers.interfaces import (
    dependencies,
    installed_names,
    list_interfaces,
    needed_packages,
    share_folder,
    show,
)

INSTALLED = installed_names()

# A line of an interface, and what is left of it in a nested message (None: nothing).
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
    def listing(name):
        capsys.readouterr()
        show(name)
        return capsys.readouterr().out

    return listing


# --- show ---


@pytest.mark.parametrize(('line', 'bare'), CORNERS)
def test_a_line_of_an_interface_and_of_a_nested_one(prefix, listing, line, bare):
    prefix.add('corner_msgs/msg/Inner', f'{line}\nbool end')
    prefix.add('corner_msgs/msg/Outer', 'Inner inner # here\n')
    assert listing('corner_msgs/msg/Inner').splitlines() == [line.rstrip(), 'bool end']
    below = [f'\t{text}' for text in (bare, 'bool end') if text is not None]
    assert listing('corner_msgs/msg/Outer').splitlines() == ['Inner inner # here', *below]


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
def test_each_installed_interface_is_shown_whole(package, listing):
    for name in (name for name in INSTALLED if name.startswith(f'{package}/')):
        kind, short = name.split('/')[1:]
        file = share_folder(package) / kind / f'{short}.{kind}'
        text = listing(name)
        # The file itself is there, line by line, with the nested messages between its lines.
        own = [line.rstrip() for line in file.read_text(encoding='utf-8').splitlines()]
        assert [line for line in text.splitlines() if not line.startswith('\t')] == own
        # Both show the same fields in the same order and depth.
        table = dependencies(name)
        top = 1 if kind == 'msg' else 2
        rows = table[table.depth >= top].itertuples()
        tree = [(row.depth - top, row.type.rpartition('/')[2], row.field) for row in rows]
        assert list(fields_of(text)) == tree


def test_an_overlay_wins_and_a_change_is_seen(prefix, listing):
    prefix.add('std_msgs/msg/String', 'string data # changed\n')
    assert listing('std_msgs/msg/String') == 'string data # changed\n'
    (prefix.share / 'std_msgs/msg/String.msg').write_text('string other\n')
    assert listing('std_msgs/msg/String') == 'string other\n'


@pytest.mark.parametrize(
    ('name', 'hint'),
    [
        ('sensor_msgs/Image', 'The nearest: sensor_msgs/msg/Image.'),
        ('sensor_msg/msg/Imagge', 'The nearest: sensor_msgs/msg/Image.'),
        ('custom_interfaces/msg/Twist', 'The nearest: geometry_msgs/msg/Twist.'),
        ('qqq', 'list_interfaces() prints all names.'),
        (int, 'list_interfaces() prints all names.'),
    ],
)
def test_a_wrong_name_gets_one_sentence_with_the_nearest(name, hint):
    for function in (show, dependencies, needed_packages):
        with pytest.raises(ValueError, match='^There is no interface') as caught:
            function(name)
        assert str(caught.value) == f'There is no interface {name!r}. {hint}'


# --- list and dependencies ---


def test_list_interfaces(prefix, capsys):
    prefix.add('custom_interfaces/srv/TurnCamera', '---\n')
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
    assert '    custom_interfaces/action/Turn' in actions
    assert actions == sorted(actions)
    assert not [line for line in lines if 'TurnCamera_Request' in line]
    assert len(lines) == len(installed_names()) + 3 == len(set(lines))
    list_interfaces('custom')
    assert capsys.readouterr().out == (
        '    custom_interfaces/srv/TurnCamera\n    custom_interfaces/action/Turn\n'
    )


def test_dependencies_and_the_packages_that_are_needed_also_by_own_messages(prefix):
    prefix.add('own_msgs/msg/Inner', 'geometry_msgs/Pose[<=2] poses\nstring<=4 s\n')
    prefix.add('own_msgs/action/Outer', 'Inner inner\n---\nnav_msgs/Path path\n---\nuint8[3] x\n')
    assert needed_packages('own_msgs/action/Outer') == ['geometry_msgs', 'nav_msgs']
    table = dependencies('own_msgs/action/Outer')
    assert table[table.depth == 1].field.tolist() == ['goal', 'result', 'feedback']
    rows = list(table.itertuples(index=False, name=None))
    assert rows[:4] == [
        (0, 'Outer', 'own_msgs/action/Outer', 'own_msgs', ''),
        (1, 'goal', 'own_msgs/action/Outer_Goal', 'own_msgs', ''),
        (2, 'inner', 'own_msgs/msg/Inner', 'own_msgs', ''),
        (3, 'poses', 'geometry_msgs/msg/Pose', 'geometry_msgs', '[<=2]'),
    ]
    assert table[table.field == 's'].type.tolist() == ['string<=4']
    assert table.iloc[-1].array == '[3]'
    assert needed_packages('std_msgs/msg/String') == []
