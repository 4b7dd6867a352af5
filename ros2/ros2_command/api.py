"""What other programs may import of this package.

packages, interfaces    what is installed, and where
command_of              the command that `ros2 run` runs
interface_lines         the lines that `ros2 interface show` prints
CommandError            the sentence that `ros2` prints if it cannot do what it is asked for
"""

from ros2_command.commands import CommandError
from ros2_command.index import command_of, interfaces, packages
from ros2_command.interfaces import interface_lines

__all__ = ['CommandError', 'command_of', 'interface_lines', 'interfaces', 'packages']
