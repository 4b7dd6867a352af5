"""Various lifecycle related sub-commands."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState

from helpers.ros2._commands import CommandError, command, option
from helpers.ros2._graph import Graph, graph
from helpers.ros2._names import NODE, NODE_OR_ALL, graph_with_node, node_names


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
        for one in _transitions(opened, node):
            print(f'- {one.transition.label} [{one.transition.id}]')
            print(f'\tStart: {one.start_state.label}\n\tGoal: {one.goal_state.label}')


def _transitions(opened: Graph, node: str) -> list:
    return opened.call(node, GetAvailableTransitions).available_transitions


@command(NODE, option('transition', 'The lifecycle transition, by its name or number'))
def _set(args: argparse.Namespace) -> None:
    """Trigger lifecycle state transition."""
    with graph_with_node(args.node_name, _lifecycle_nodes) as (opened, node):
        known = [one.transition for one in _transitions(opened, node)]
        wanted = [one for one in known if args.transition in (one.label, str(one.id))]
        if not wanted:
            labels = [f'\n- {one.label} [{one.id}]' for one in known]
            text = 'Unknown transition requested, available ones are:'
            raise CommandError(text + ''.join(labels))
        done = opened.call(node, ChangeState, transition=wanted[0]).success
    print('Transitioning successful') if done else print('Transitioning failed', file=sys.stderr)
