"""A command is a function with its arguments: its name is the word, its docstring the help."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping
from types import ModuleType
from typing import Any, NamedTuple

# What this package imports of ROS 2. The extra `ros` of its pyproject.toml installs it.
ROS = {'lifecycle_msgs', 'rcl_interfaces', 'rclpy', 'rosgraph_msgs', 'rosidl_adapter'}


class CommandError(Exception):
    """A user's mistake: one sentence for stderr, and the exit status of the real command."""

    def __init__(self, sentence: object, status: int = 1) -> None:
        super().__init__(str(sentence))
        self.status = status


def what_is_missing(error: ModuleNotFoundError) -> str:
    """Return a sentence that says which package of ROS 2 is not installed, and what installs it.

    Raises the error itself if it is about another module.
    """
    if error.name not in ROS:
        raise error
    # Without rclpy the others are missing, too, and each verb imports another one first.
    name = error.name if importlib.util.find_spec('rclpy') else 'rclpy'
    return (
        f'ros2 needs {name}, which the Python in {sys.prefix} does not have: install the wheels of '
        "ROS 2 with `pip install 'ros2-command[ros]'`, or source a ROS 2 in this terminal."
    )


class Argument(NamedTuple):
    """An option, for example `-r --rate`, or an argument, and what Tab completes for it."""

    names: str
    settings: dict[str, Any]
    complete: Callable[..., list[str]] | None = None


def flag(names: str, help_: str, **settings: Any) -> Argument:
    """Return an option without a value."""
    return Argument(names, {'action': 'store_true', 'help': help_, **settings})


def option(names: str, help_: str, complete: Any = None, **settings: Any) -> Argument:
    """Return an option with a value, or an argument without a dash."""
    return Argument(names, {'help': help_, **settings}, complete)


VALUES = option('values', "Values in YAML (e.g. '{data: 1}')", nargs='?', default='{}')


def command(*arguments: Argument) -> Callable[[Callable], Callable]:
    """Make a function a command: `_list` becomes `list`, with these arguments."""

    def mark(function: Callable) -> Callable:
        function.arguments = arguments
        return function

    return mark


def positive(text: str) -> float:
    """Return a number above 0, as the type of an argument."""
    if (value := float(text)) > 0:
        return value
    raise ValueError


def natural(text: str) -> int:
    """Return an integer of at least 0, as the type of an argument."""
    if (value := int(text)) >= 0:
        return value
    raise ValueError


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one sentence each."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self.set_defaults(run=lambda args: self.print_help())

    def add(self, arguments: Iterable[Argument]) -> None:
        """Add arguments."""
        for names, settings, complete in arguments:
            self.add_argument(*names.split(), **settings).completer = complete

    def add_parsers(self, helps: Mapping[str, str]) -> dict[str, Parser]:
        """Add a parser for each word, with its help, and return them."""
        width = max(map(len, helps))
        parsers = self.add_subparsers(
            title='Commands',
            description='\n'.join(f'{name:{width}}  {line}' for name, line in helps.items()),
            metavar=f'Call `{self.prog} <command> -h` for more detailed usage.',
            parser_class=Parser,
        )
        return {name: parsers.add_parser(name, description=line) for name, line in helps.items()}

    def add_commands(self, module: ModuleType) -> None:
        """Add the commands of a verb's module, or the only one if it has the name of the verb."""
        functions = {
            function.__name__.strip('_'): function
            for function in vars(module).values()
            if hasattr(function, 'arguments')
        }
        parsers = {self.prog.split()[-1]: self}
        if functions.keys() != parsers.keys():
            self.add(getattr(module, 'ARGUMENTS', ()))
            helps = {name: title(functions[name].__doc__) for name in sorted(functions)}
            parsers = self.add_parsers(helps)
        for name, function in functions.items():
            parsers[name].add(function.arguments)
            parsers[name].set_defaults(run=function)

    def error(self, message: str) -> None:  # noqa: D102
        sentence = message.rpartition('usage.: ')[2]  # without the long name of the commands
        raise CommandError(f'{self.prog}: error: {sentence} (see `{self.prog} -h`)', 2)


def title(docstring: str) -> str:
    """Return the first line of a docstring, without its period."""
    return docstring.partition('\n')[0].rstrip('.')
