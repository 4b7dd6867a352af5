"""Various node related sub-commands."""

from __future__ import annotations

import argparse
import sys

from rclpy import action

from ros2_command.commands import CommandError, command, flag
from ros2_command.graph import graph
from ros2_command.names import NODE, is_hidden, node_names, split_node_name


@command(
    flag('-a --all', 'Display all nodes even hidden ones'),
    flag('-c --count-nodes', 'Only display the number of nodes discovered'),
)
def _list(args: argparse.Namespace) -> None:
    """Output a list of available nodes."""
    with graph() as opened:
        names = sorted(node_names(opened.node, args.all))
    if len(set(names)) < len(names) and not args.count_nodes:
        print(
            'WARNING: Be aware that there are nodes in the graph that share an exact name, which '
            'can have unintended side effects.',
            file=sys.stderr,
        )
    if args.count_nodes:
        print(len(names))
        return
    for name in names:
        print(name)


@command(NODE)
def _info(args: argparse.Namespace) -> None:
    """Output information about a node."""
    name = args.node_name
    with graph(lambda node: name in node_names(node)) as opened:
        node = opened.node
        if name not in node_names(node):
            raise CommandError(f"Unable to find node '{name}'")
        print(name)
        own = split_node_name(name)
        for title, endpoints in (
            ('Subscribers', node.get_subscriber_names_and_types_by_node(*own)),
            ('Publishers', node.get_publisher_names_and_types_by_node(*own)),
            ('Service Servers', node.get_service_names_and_types_by_node(*own)),
            ('Service Clients', node.get_client_names_and_types_by_node(*own)),
            ('Action Servers', action.get_action_server_names_and_types_by_node(node, *own)),
            ('Action Clients', action.get_action_client_names_and_types_by_node(node, *own)),
        ):
            lines = [
                f'    {endpoint}: {", ".join(types)}'
                for endpoint, types in endpoints
                if not is_hidden(endpoint)
            ]
            print(f'  {title}:')
            print(*lines, sep='\n')  # an empty line if there is none, as the real command
