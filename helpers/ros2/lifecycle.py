"""Various lifecycle related sub-commands."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from typing import Any

from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import Graph, graph
from helpers.ros2._names import complete_nodes, graph_with_node, node_names


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 lifecycle`."""
    nodes, get, set_, listing = parser.functions(_nodes, _get, _set, _list)
    nodes.flag('-a --all', 'Display all nodes even hidden ones')
    nodes.flag('-c --count-nodes', 'Only display the number of nodes discovered')
    for command in (get, set_, listing):
        command.flag('--include-hidden-nodes', 'Consider hidden nodes as well')
        nargs = '?' if command is get else None
        command.option('node_name', 'Name of the ROS node', complete_nodes, nargs=nargs)
    set_.option('transition', 'The lifecycle transition')
    listing.flag('-a --all', 'Display all existing transitions')
    for command in (nodes, get, set_, listing):
        command.graph_options()


def _lifecycle_nodes(node: Any, hidden: bool) -> list[str]:
    services = dict(node.get_service_names_and_types())
    kind = 'lifecycle_msgs/srv/GetState'
    names = sorted(set(node_names(node, hidden)))
    return [name for name in names if kind in services.get(f'{name}/get_state', [])]


def _call(opened: Graph, node: str, service: str, kind: str, **fields: Any) -> Any:
    from lifecycle_msgs import srv

    return opened.call(getattr(srv, kind), f'{node}/{service}', **fields)


def _nodes(args: argparse.Namespace) -> None:
    """Output a list of nodes with lifecycle."""
    with graph(args) as opened:
        names = _lifecycle_nodes(opened.node, args.all)
    for line in [len(names)] if args.count_nodes else names:
        print(line)


def _get(args: argparse.Namespace) -> None:
    """Get lifecycle state for one or more nodes."""
    with graph_with_node(args, _lifecycle_nodes) if args.node_name else _all(args) as found:
        opened, names = found
        for name in [names] if args.node_name else names:
            state = _call(opened, name, 'get_state', 'GetState').current_state
            prefix = '' if args.node_name else f'{name}: '
            print(f'{prefix}{state.label} [{state.id}]')


@contextlib.contextmanager
def _all(args: argparse.Namespace) -> Iterator[tuple[Graph, list[str]]]:
    with graph(args) as opened:
        yield opened, _lifecycle_nodes(opened.node, args.include_hidden_nodes)


def _list(args: argparse.Namespace) -> None:
    """Output a list of available transitions."""
    service = 'get_transition_graph' if args.all else 'get_available_transitions'
    with graph_with_node(args, _lifecycle_nodes) as (opened, node):
        found = _call(opened, node, service, 'GetAvailableTransitions').available_transitions
    for one in found:
        print(f'- {one.transition.label} [{one.transition.id}]')
        print(f'\tStart: {one.start_state.label}\n\tGoal: {one.goal_state.label}')


def _set(args: argparse.Namespace) -> None:
    """Trigger lifecycle state transition."""
    with graph_with_node(args, _lifecycle_nodes) as (opened, node):
        service = 'get_available_transitions'
        found = _call(opened, node, service, 'GetAvailableTransitions').available_transitions
        known = {str(one.transition.id): one.transition for one in found}
        known |= {one.transition.label: one.transition for one in found}
        if args.transition not in known:
            labels = [f'\n- {one.transition.label} [{one.transition.id}]' for one in found]
            text = 'Unknown transition requested, available ones are:'
            raise CommandError(text + ''.join(labels))
        transition = known[args.transition]
        done = _call(opened, node, 'change_state', 'ChangeState', transition=transition).success
    print('Transitioning successful') if done else print('Transitioning failed', file=sys.stderr)
