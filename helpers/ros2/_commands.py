"""Commands below a command, their options in a line each, and errors of one sentence."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from typing import Any

from helpers.ros2._errors import CommandError


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one sentence each."""

    def __init__(self, **settings: Any) -> None:
        settings.setdefault('formatter_class', argparse.RawDescriptionHelpFormatter)
        super().__init__(**settings)
        self.set_defaults(run=lambda args: self.print_help())

    def flag(self, names: str, help_: str, **settings: Any) -> None:
        """Add an option without a value, for example `-t --show-types`."""
        self.add_argument(*names.split(), action='store_true', help=help_, **settings)

    def option(self, names: str, help_: str, complete: Any = None, **settings: Any) -> None:
        """Add an option with a value, or an argument, and what Tab completes for it."""
        self.add_argument(*names.split(), help=help_, **settings).completer = complete

    def values(self, name: str, help_: str) -> None:
        """Add an argument for YAML, which can also come from standard input."""
        group = self.add_mutually_exclusive_group()
        group.add_argument(name, nargs='?', default='{}', help=help_)
        stdin = {'action': 'store_const', 'const': sys.stdin, 'help': 'Read it from standard input'}
        group.add_argument('--stdin', dest=name, **stdin)

    def graph_options(self) -> None:
        """Add the options with which the real command chooses how it looks at the graph."""
        self.option('--spin-time', 'Seconds to wait for discovery', type=float)
        self.flag('-s --use-sim-time', 'Enable ROS simulation time')
        self.flag('--no-daemon', 'There is none: for scripts that say so')

    def commands(self, helps: Mapping[str, str]) -> dict[str, Parser]:
        """Add a command for each name, with its help, and return their parsers."""
        width = max(map(len, helps))
        commands = self.add_subparsers(
            title='Commands',
            description='\n'.join(f'{name:{width}}  {line}' for name, line in helps.items()),
            metavar=f'Call `{self.prog} <command> -h` for more detailed usage.',
            parser_class=Parser,
        )
        return {name: commands.add_parser(name, description=line) for name, line in helps.items()}

    def functions(self, *functions: Callable) -> list[Parser]:
        """Add a command for each function: `_list` is `list`, and its docstring the help."""
        helps = {f.__name__[1:]: f.__doc__.partition('\n')[0].rstrip('.') for f in functions}
        parsers = self.commands(dict(sorted(helps.items())))
        for function in functions:
            parsers[function.__name__[1:]].set_defaults(run=function)
        return [parsers[name] for name in helps]

    def error(self, message: str) -> None:  # noqa: D102
        raise CommandError(f'{self.prog}: error: {message} (see `{self.prog} -h`)', 2)

    def _check_value(self, action: argparse.Action, value: str) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            known = ', '.join(action.choices)
            raise CommandError(f"{self.prog}: error: there is no '{value}', only {known}", 2)
        super()._check_value(action, value)


def number(kind: type, least: float, above: bool = False) -> Callable[[str], Any]:
    """Return the type of an argument: a number that is not below a limit, or `above` it."""

    def read(text: str) -> Any:
        try:
            value = kind(text)
            if value > least or (value == least and not above):
                return value
        except ValueError:
            pass
        what = 'an integer' if kind is int else 'a number'
        limit = f'above {least}' if above else f'of at least {least}'
        raise argparse.ArgumentTypeError(f'value must be {what} {limit}')

    return read
