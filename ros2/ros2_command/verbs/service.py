"""Various service related sub-commands."""

from __future__ import annotations

import argparse

from ros2_command.commands import VALUES, command
from ros2_command.graph import graph
from ros2_command.names import Names
from ros2_command.values import filled, find_type

SERVICES = Names('service', 'srv', lambda node: node.get_service_names_and_types())
ARGUMENTS = (SERVICES.hidden,)


@command(SERVICES.show_types, SERVICES.count, SERVICES.hidden_below)
def _list(args: argparse.Namespace) -> None:
    """Output a list of available services."""
    SERVICES.print_names(args)


@command(SERVICES.name)
def _type(args: argparse.Namespace) -> int:
    """Output a service's type."""
    return SERVICES.print_types(args, args.service_name)


@command(SERVICES.type, SERVICES.count, SERVICES.hidden_below)
def _find(args: argparse.Namespace) -> None:
    """Output a list of available services of a given type."""
    SERVICES.print_names(args, args.service_type)


@command(SERVICES.name, SERVICES.type, VALUES)
def _call(args: argparse.Namespace) -> None:
    """Call a service."""
    class_ = find_type(args.service_type, 'srv', 'The passed service type is invalid')
    request = filled(class_.Request(), args.values, 'Failed to populate field: {}')
    with graph(name=f'_ros2cli_requester_{class_.__name__}') as opened:
        client = opened.node.create_client(class_, args.service_name)
        if not client.wait_for_service(0.1):
            print('waiting for service to become available...')
            client.wait_for_service()
        print(f'requester: making request: {request!r}\n')
        response = opened.result(client.call_async(request), 'calling service')
        print(f'response:\n{response!r}\n')
