"""Various action related sub-commands."""

from __future__ import annotations

import argparse
from typing import Any

from rclpy import action
from rclpy.action import ActionClient, get_action_names_and_types

from ros2_command.commands import VALUES, command, flag
from ros2_command.graph import full_name, graph
from ros2_command.guards import uninterrupted
from ros2_command.names import Names
from ros2_command.values import filled, find_type, to_yaml

ACTIONS = Names('action', 'action', get_action_names_and_types)
LATE_S = 0.1


@command(ACTIONS.show_types, ACTIONS.count)
def _list(args: argparse.Namespace) -> None:
    """Output a list of action names."""
    ACTIONS.print_names(args)


@command(ACTIONS.name, ACTIONS.show_types)
def _info(args: argparse.Namespace) -> None:
    """Print information about an action."""
    with graph(lambda node: args.action_name in ACTIONS.types(node)) as opened:
        node = opened.node
        wanted = full_name(node, args.action_name)
        nodes = node.get_node_names_and_namespaces()
        print(f'Action: {args.action_name}')
        for word, get in (
            ('clients', action.get_action_client_names_and_types_by_node),
            ('servers', action.get_action_server_names_and_types_by_node),
        ):
            sides = [
                (f'{namespace.rstrip("/")}/{name}', types)
                for name, namespace in nodes
                for action_name, types in get(node, name, namespace)
                if action_name == wanted
            ]
            print(f'Action {word}: {len(sides)}')
            for name, types in sides:
                print(f'    {name} [{", ".join(types)}]' if args.show_types else f'    {name}')


@command(ACTIONS.name, ACTIONS.type, VALUES, flag('-f --feedback', 'Echo the feedback of the goal'))
def _send_goal(args: argparse.Namespace) -> None:
    """Send an action goal."""
    class_ = find_type(args.action_type, 'action', 'The passed action type is invalid')
    goal = filled(class_.Goal(), args.values, 'Failed to populate message fields: {!r}')
    statuses = ['UNKNOWN', 'ACCEPTED', 'EXECUTING', 'CANCELING', 'SUCCEEDED', 'CANCELED', 'ABORTED']

    early: list[Any] = []  # feedback that overtook the answer to the goal
    accepted = False

    def show(message: Any) -> None:
        if accepted:
            print(f'Feedback:\n    {to_yaml(message.feedback)}')
        else:
            early.append(message)

    with graph() as opened:
        client = ActionClient(opened.node, class_, args.action_name)
        print('Waiting for an action server to become available...')
        client.wait_for_server()
        print(f'Sending goal:\n     {to_yaml(goal)}')
        sent = client.send_goal_async(goal, show if args.feedback else None)
        handle = opened.result(sent, 'sending goal')
        if not handle.accepted:
            print('Goal was rejected.')
            return
        print(f'Goal accepted with ID: {bytes(handle.goal_id.uuid).hex()}\n')
        accepted = True
        for message in early:
            show(message)
        try:
            answer = opened.result(handle.get_result_async(), 'getting result')
        except KeyboardInterrupt:
            with uninterrupted():
                print('Canceling goal...')
                opened.result(handle.cancel_goal_async(), 'canceling goal')
                print('Goal canceled.')
            raise
        if args.feedback:  # what came before the result, and waits to be shown
            opened.spin_until(lambda: False, LATE_S)
        print(f'Result:\n    {to_yaml(answer.result)}')
        print(f'Goal finished with status: {statuses[answer.status]}')
