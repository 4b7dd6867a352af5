"""An interface is shown as the `ros2` command shows it."""

import re
from pathlib import Path

import pytest

from helpers.ros.interfaces import share_folder, show


def test_shows_the_file_with_what_it_nests(capsys):
    show('sensor_msgs/msg/BatteryState')
    lines = capsys.readouterr().out.splitlines()
    file = share_folder('sensor_msgs') / 'msg' / 'BatteryState.msg'
    own = [line.rstrip() for line in file.read_text(encoding='utf-8').splitlines()]
    assert [line for line in lines if not line.startswith('\t')] == own
    assert lines[lines.index('std_msgs/Header  header') + 1 :][:2] == [
        '\tbuiltin_interfaces/Time stamp',
        '\t\tint32 sec',
    ]


@pytest.mark.parametrize(
    ('name', 'hint'),
    [
        ('sensor_msgs/Image', 'The nearest: sensor_msgs/msg/Image.'),
        ('sensor_msg/msg/Imagge', 'The nearest: sensor_msgs/msg/Image.'),
        ('custom_interfaces/msg/Twist', 'The nearest: geometry_msgs/msg/Twist.'),
        ('qqq', '`ros2 interface list` prints all names.'),
        (int, '`ros2 interface list` prints all names.'),
    ],
)
def test_a_wrong_name_gets_the_nearest_one(name, hint):
    with pytest.raises(ValueError, match='^There is no interface') as caught:
        show(name)
    assert str(caught.value) == f'There is no interface {name!r}. {hint}'


def test_helpers_import_the_door_of_the_command_only():
    helpers = Path(__file__).parents[1] / 'helpers'
    doors = {
        module
        for file in helpers.rglob('*.py')
        for module in re.findall(r'(?m)^ *(?:from|import) (ros2_command\S*)', file.read_text())
    }
    assert doors == {'ros2_command.api'}
