"""The commands that topics, services and actions have in common: list, type, find and info."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from helpers.ros2 import _index
from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import Graph, graph, wait_for

UNNAMED_S = 5.0  # for the nodes of a participant that was found
Types = dict[str, list[str]]


class Names:
    """The names of one kind, such as `topic`, each with its types, as `get(node)` gives them."""

    def __init__(self, word: str, kind: str, get: Callable[[Any], list]) -> None:
        self.word, self.kind, self._get = word, kind, get
        self.hidden_flag = f'--include-hidden-{word}s', f'Consider hidden {word}s as well'

    def types(self, node: Any, hidden: bool = True) -> Types:
        """Return the types of each name."""
        return {n: t for n, t in self._get(node) if hidden or not is_hidden(n)}

    def complete(self, **kwargs: Any) -> list[str]:
        """Return the names, for Tab."""
        with graph(argparse.Namespace()) as opened:
            return list(self.types(opened.node))

    def complete_types(self, **kwargs: Any) -> list[str]:
        """Return the types that are installed, for Tab."""
        return [name for name in _index.interfaces() if name.split('/')[1] == self.kind]

    def add_listing(self, parser: Parser, hidden: bool = True) -> None:
        """Add the options of `list` and `find`."""
        if hidden:  # the default would replace what was said before the command
            parser.flag(*self.hidden_flag, default=argparse.SUPPRESS)
        parser.flag(f'-c --count-{self.word}s', f'Only display the number of {self.word}s')

    def list(self, args: argparse.Namespace) -> None:
        """Print the names, with --show-types their types."""
        with graph(args) as opened:
            found = self.types(opened.node, self._hidden(args))
        self._print(
            args, [f'{n} [{", ".join(t)}]' if args.show_types else n for n, t in found.items()]
        )

    def find(self, args: argparse.Namespace, type_: str) -> None:
        """Print the names that have a type."""
        with graph(args) as opened:
            found = self.types(opened.node, self._hidden(args))
        self._print(args, [name for name, types in found.items() if type_ in types])

    def type(self, args: argparse.Namespace, name: str) -> int:
        """Print the types of a name, and return the status: 1 if there is none."""
        hidden = self._hidden(args)
        with graph(args, lambda node: name in self.types(node, hidden)) as opened:
            types = self.types(opened.node, hidden).get(name, [])
        for type_ in types:
            print(type_)
        return 0 if types else 1

    def _hidden(self, args: argparse.Namespace) -> bool:
        return getattr(args, f'include_hidden_{self.word}s', True)

    def _print(self, args: argparse.Namespace, lines: list[str]) -> None:
        if getattr(args, f'count_{self.word}s'):
            lines = [str(len(lines))]
        for line in lines:
            print(line)


def is_hidden(name: str) -> bool:
    """Whether a part of a name begins with `_`."""
    return any(part.startswith('_') for part in name.split('/'))


def node_names(node: Any, hidden: bool = False) -> list[str]:
    """Return the full names of the nodes, each as often as it is there."""
    found = node.get_node_names_and_namespaces()
    return [f'{s.rstrip("/")}/{n}' for n, s in found if hidden or not n.startswith('_')]


def split_node_name(name: str) -> tuple[str, str]:
    """Return the name of a node without its namespace, and its namespace."""
    space, _, last = f'/{name.removeprefix("/")}'.rpartition('/')
    return last, space or '/'


@contextlib.contextmanager
def graph_with_node(
    args: argparse.Namespace, names: Callable[[Any, bool], list[str]] = node_names
) -> Iterator[tuple[Graph, str]]:
    """Open a graph that has the node of the arguments, which is yielded as well by its full name.

    `names` returns the nodes that count. Raises CommandError if it is not one of them in time.
    """
    name = f'/{args.node_name.removeprefix("/")}'

    def found(node: Any) -> bool:
        return name in names(node, args.include_hidden_nodes)

    with graph(args, found) as opened:
        # On a busy machine, a participant may be known long before its nodes are.
        wait_for(lambda: found(opened.node) or opened.is_whole(), UNNAMED_S)
        if not wait_for(lambda: found(opened.node), getattr(args, 'timeout', 1) - 1):
            raise CommandError('Node not found')
        yield opened, name


def complete_nodes(**kwargs: Any) -> list[str]:
    """Return the names of the nodes, for Tab."""
    with graph(argparse.Namespace()) as opened:
        return node_names(opened.node)
