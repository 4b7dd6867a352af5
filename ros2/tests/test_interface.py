"""The listings of interfaces are what the real command prints, letter by letter."""

import pytest

from ros2_command.api import interfaces, packages

INSTALLED = interfaces()

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
def shown(run):
    """Return a function that returns the lines which the command shows."""

    def shown(name):
        status, out, err = run(f'interface show {name}')
        assert (status, err) == (0, '')
        return out.splitlines()

    return shown


@pytest.mark.parametrize(('line', 'bare'), CORNERS)
def test_lines_are_shown_as_the_command_does(prefix, shown, line, bare):
    prefix.add('corner_msgs/msg/Inner', f'{line}\nbool end')
    prefix.add('corner_msgs/msg/Outer', 'Inner inner # here\n')
    assert shown('corner_msgs/msg/Inner') == [line.rstrip(), 'bool end']
    below = [f'\t{text}' for text in (bare, 'bool end') if text is not None]
    assert shown('corner_msgs/msg/Outer') == ['Inner inner # here', *below]


@pytest.mark.parametrize('package', sorted({name.split('/')[0] for name in INSTALLED}))
def test_each_installed_interface_is_shown_whole(package, shown):
    for name in (name for name in INSTALLED if name.startswith(f'{package}/')):
        kind, short = name.split('/')[1:]
        file = packages()[package] / 'share' / package / kind / f'{short}.{kind}'
        # The file itself is there, line by line, with the nested messages between its lines.
        own = [line.rstrip() for line in file.read_text(encoding='utf-8').splitlines()]
        assert [line for line in shown(name) if not line.startswith('\t')] == own
