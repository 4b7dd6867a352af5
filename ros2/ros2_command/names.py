"""The names in the graph: of nodes, and of topics, services and actions, each with its types."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from ros2_command import index
from ros2_command.commands import CommandError, flag, option
from ros2_command.discovery import is_whole, wait_for
from ros2_command.graph import Graph, graph

UNNAMED_S = 5.0  # for the nodes of a participant that was found


class Names:
    """The names of one kind, such as `topic`, as `get(node)` gives them, and their commands."""

    def __init__(self, word: str, kind: str, get: Callable[[Any], list]) -> None:
        self.word, self.kind, self._get = word, kind, get
        hidden = f'--include-hidden-{word}s', f'Consider hidden {word}s as well'
        self.hidden = flag(*hidden)
        # The default would replace what was said before the command.
        self.hidden_below = flag(*hidden, default=argparse.SUPPRESS)
        self.show_types = flag('-t --show-types', f'Additionally show the {word} type')
        self.count = flag(f'-c --count-{word}s', f'Only display the number of {word}s')
        self.name = option(f'{word}_name', f'Name of the {word}', self.complete)
        self.type = option(f'{word}_type', f'Type of the {word}', self.complete_types)

    def types(self, node: Any, hidden: bool = True) -> dict[str, list[str]]:
        """Return the types of each name."""
        return {name: types for name, types in self._get(node) if hidden or not is_hidden(name)}

    def complete(self, **kwargs: Any) -> list[str]:
        """Return the names, for Tab."""
        with graph() as opened:
            return list(self.types(opened.node))

    def complete_types(self, **kwargs: Any) -> list[str]:
        """Return the types that are installed, for Tab."""
        return [name for name in index.interfaces() if name.split('/')[1] == self.kind]

    def print_names(self, args: argparse.Namespace, type_: str | None = None) -> None:
        """Print the names, or those of a type, with --show-types their types."""
        with graph() as opened:
            types_by_name = self.types(opened.node, self._is_hidden_shown(args))
        lines = [
            f'{name} [{", ".join(types)}]' if getattr(args, 'show_types', False) else name
            for name, types in types_by_name.items()
            if type_ is None or type_ in types
        ]
        if getattr(args, f'count_{self.word}s'):
            print(len(lines))
            return
        for line in lines:
            print(line)

    def print_types(self, args: argparse.Namespace, name: str) -> int:
        """Print the types of a name, and return the status: 1 if there is none."""
        hidden = self._is_hidden_shown(args)
        with graph(lambda node: name in self.types(node, hidden)) as opened:
            types = self.types(opened.node, hidden).get(name, [])
        for type_ in types:
            print(type_)
        return 0 if types else 1

    def _is_hidden_shown(self, args: argparse.Namespace) -> bool:
        return getattr(args, f'include_hidden_{self.word}s', True)


def is_hidden(name: str) -> bool:
    """Return whether a part of a name begins with `_`."""
    return any(part.startswith('_') for part in name.split('/'))


def node_names(node: Any, hidden: bool = False) -> list[str]:
    """Return the full names of the nodes, each as often as it is there."""
    return [
        f'{namespace.rstrip("/")}/{name}'
        for name, namespace in node.get_node_names_and_namespaces()
        if hidden or not name.startswith('_')
    ]


def split_node_name(name: str) -> tuple[str, str]:
    """Return the name of a node without its namespace, and its namespace."""
    namespace, _, last = f'/{name.removeprefix("/")}'.rpartition('/')
    return last, namespace or '/'


@contextlib.contextmanager
def graph_with_node(
    name: str, names: Callable[[Any], list[str]] = node_names
) -> Iterator[tuple[Graph, str]]:
    """Open a graph that has a node, which is yielded as well by its full name.

    `names` returns the nodes that count. Raises CommandError if it is not one of them in time.
    """
    full = f'/{name.removeprefix("/")}'
    with graph(lambda node: full in names(node)) as opened:
        # On a busy machine, a participant may be known long before its nodes are.
        wait_for(lambda: full in names(opened.node) or is_whole(opened.node), UNNAMED_S)
        if full not in names(opened.node):
            raise CommandError('Node not found')
        yield opened, full


def complete_nodes(**kwargs: Any) -> list[str]:
    """Return the names of the nodes, for Tab."""
    with graph() as opened:
        return node_names(opened.node)


NODE = option('node_name', 'Name of the ROS node', complete_nodes)
NODE_OR_ALL = option('node_name', 'Name of the ROS node', complete_nodes, nargs='?')
