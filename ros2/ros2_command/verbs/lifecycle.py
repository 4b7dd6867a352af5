"""Various lifecycle related sub-commands."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState

from ros2_command.commands import CommandError, command, option
from ros2_command.graph import Graph, graph
from ros2_command.names import NODE, NODE_OR_ALL, graph_with_node, node_names


def _lifecycle_nodes(node: Any) -> list[str]:
    services = dict(node.get_service_names_and_types())
    kind = 'lifecycle_msgs/srv/GetState'
    names = sorted(set(node_names(node)))
    return [name for name in names if kind in services.get(f'{name}/get_state', [])]


@command()
def _nodes(args: argparse.Namespace) -> None:
    """Output a list of nodes with lifecycle."""
    with graph() as opened:
        for name in _lifecycle_nodes(opened.node):
            print(name)


@command(NODE_OR_ALL)
def _get(args: argparse.Namespace) -> None:
    """Get lifecycle state for one or more nodes."""
    if args.node_name:
        with graph_with_node(args.node_name, _lifecycle_nodes) as (opened, name):
            print(_state(opened, name))
        return
    with graph() as opened:
        for name in _lifecycle_nodes(opened.node):
            print(f'{name}: {_state(opened, name)}')


def _state(opened: Graph, node: str) -> str:
    state = opened.call(node, GetState).current_state
    return f'{state.label} [{state.id}]'


@command(NODE)
def _list(args: argparse.Namespace) -> None:
    """Output a list of available transitions."""
    with graph_with_node(args.node_name, _lifecycle_nodes) as (opened, node):
        for available in _transitions(opened, node):
            print(f'- {available.transition.label} [{available.transition.id}]')
            print(f'\tStart: {available.start_state.label}\n\tGoal: {available.goal_state.label}')


def _transitions(opened: Graph, node: str) -> list:
    return opened.call(node, GetAvailableTransitions).available_transitions


@command(NODE, option('transition', 'The lifecycle transition, by its name or number'))
def _set(args: argparse.Namespace) -> None:
    """Trigger lifecycle state transition."""
    with graph_with_node(args.node_name, _lifecycle_nodes) as (opened, node):
        transitions = [available.transition for available in _transitions(opened, node)]
        wanted = [t for t in transitions if args.transition in (t.label, str(t.id))]
        if not wanted:
            lines = ['Unknown transition requested, available ones are:']
            lines += [f'- {transition.label} [{transition.id}]' for transition in transitions]
            raise CommandError('\n'.join(lines))
        is_done = opened.call(node, ChangeState, transition=wanted[0]).success
    if is_done:
        print('Transitioning successful')
    else:
        print('Transitioning failed', file=sys.stderr)
