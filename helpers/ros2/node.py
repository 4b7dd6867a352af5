"""Various node related sub-commands."""

from __future__ import annotations

import argparse
import sys

from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import graph
from helpers.ros2._names import complete_nodes, is_hidden, node_names, split_node_name


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 node`."""
    listing, info = parser.functions(_list, _info)
    listing.flag('-a --all', 'Display all nodes even hidden ones')
    listing.flag('-c --count-nodes', 'Only display the number of nodes discovered')
    info.option('node_name', 'Node name to request information', complete_nodes)
    info.flag('--include-hidden', 'Display hidden topics, services, and actions as well')
    for command in (listing, info):
        command.graph_options()


def _list(args: argparse.Namespace) -> None:
    """Output a list of available nodes."""
    with graph(args) as opened:
        names = sorted(node_names(opened.node, args.all))
    if args.count_nodes:
        print(len(names))
        return
    if len(set(names)) < len(names):
        warning = (
            'WARNING: Be aware that there are nodes in the graph that share an exact name, which '
            'can have unintended side effects.'
        )
        print(warning, file=sys.stderr)
    for name in names:
        print(name)


def _info(args: argparse.Namespace) -> None:
    """Output information about a node."""
    from rclpy import action

    name, hidden = args.node_name, args.include_hidden
    with graph(args, lambda node: name in node_names(node, hidden)) as opened:
        node = opened.node
        number = node_names(node, hidden).count(name)
        if not number:
            raise CommandError(f"Unable to find node '{name}'")
        if number > 1:
            warning = (
                f'There are {number} nodes in the graph with the exact name "{name}". You are '
                'seeing information about only one of them.'
            )
            print(warning, file=sys.stderr)
        print(name)
        where = split_node_name(name)
        for title, found in (
            ('Subscribers', node.get_subscriber_names_and_types_by_node(*where)),
            ('Publishers', node.get_publisher_names_and_types_by_node(*where)),
            ('Service Servers', node.get_service_names_and_types_by_node(*where)),
            ('Service Clients', node.get_client_names_and_types_by_node(*where)),
            ('Action Servers', action.get_action_server_names_and_types_by_node(node, *where)),
            ('Action Clients', action.get_action_client_names_and_types_by_node(node, *where)),
        ):
            shown = [(n, types) for n, types in found if hidden or not is_hidden(n)]
            print(f'  {title}:')
            print(*(f'    {n}: {", ".join(types)}' for n, types in shown), sep='\n')
