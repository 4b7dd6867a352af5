"""Various action related sub-commands."""

from __future__ import annotations

import argparse
from typing import Any

from helpers._plumbing.interrupts import uninterrupted
from helpers.ros2._commands import Parser
from helpers.ros2._graph import full_name, graph
from helpers.ros2._names import Names


def _actions(node: Any) -> list:
    from rclpy.action import get_action_names_and_types

    return get_action_names_and_types(node)


ACTIONS = Names('action', 'action', _actions)

LATE_S = 0.1


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 action`."""
    listing, info, type_, send = parser.functions(_list, _info, _type, _send_goal)
    ACTIONS.add_listing(listing, hidden=False)
    for command in (info, type_, send):
        command.option('action_name', "Name of the action (e.g. '/fibonacci')", ACTIONS.complete)
    for command in (listing, info):
        command.flag('-t --show-types', 'Additionally show the action type')
    info.flag('-c --count', 'Only display the number of action clients and action servers')
    send.option('action_type', 'Type of the action', ACTIONS.complete_types)
    send.values('goal', "Goal request values in YAML (e.g. '{order: 10}')")
    send.flag('-f --feedback', 'Echo feedback messages for the goal')


def _list(args: argparse.Namespace) -> None:
    """Output a list of action names."""
    ACTIONS.list(args)


def _type(args: argparse.Namespace) -> int:
    """Print a action's type."""
    return ACTIONS.type(args, args.action_name)


def _info(args: argparse.Namespace) -> None:
    """Print information about an action."""
    from rclpy import action

    with graph(args, lambda node: args.action_name in ACTIONS.types(node)) as opened:
        node = opened.node
        wanted = full_name(node, args.action_name)
        nodes = node.get_node_names_and_namespaces()
        print(f'Action: {args.action_name}')
        for word, get in (
            ('clients', action.get_action_client_names_and_types_by_node),
            ('servers', action.get_action_server_names_and_types_by_node),
        ):
            found = [
                (f'{space.rstrip("/")}/{name}', types)
                for name, space in nodes
                for action_name, types in get(node, name, space)
                if action_name == wanted
            ]
            print(f'Action {word}: {len(found)}')
            for name, types in [] if args.count else found:
                print(f'    {name} [{", ".join(types)}]' if args.show_types else f'    {name}')


def _send_goal(args: argparse.Namespace) -> None:
    """Send an action goal."""
    from action_msgs.msg import GoalStatus
    from rclpy.action import ActionClient

    from helpers.ros2._values import filled, find_type, to_yaml

    class_ = find_type(args.action_type, 'action', 'The passed action type is invalid')
    goal, _ = filled(class_.Goal(), args.goal, 'Failed to populate message fields: {!r}')
    words = 'ACCEPTED', 'EXECUTING', 'CANCELING', 'SUCCEEDED', 'CANCELED', 'ABORTED'
    names = {getattr(GoalStatus, f'STATUS_{word}'): word for word in words}

    def show(message: Any) -> None:
        print(f'Feedback:\n    {to_yaml(message.feedback)}')

    with graph(args) as opened:
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
        print(f'Goal finished with status: {names.get(answer.status, "UNKNOWN")}')
