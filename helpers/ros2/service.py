"""Various service related sub-commands."""

from __future__ import annotations

import argparse
import time

from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import graph
from helpers.ros2._names import Names

SERVICES = Names('service', 'srv', lambda node: node.get_service_names_and_types())


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 service`."""
    parser.flag(*SERVICES.hidden_flag)
    listing, type_, find, call, info = parser.functions(_list, _type, _find, _call, _info)
    listing.flag('-t --show-types', 'Additionally show the service type')
    for command in (listing, find):
        SERVICES.add_listing(command)
    for command in (type_, call, info):
        command.option('service_name', 'Name of the service', SERVICES.complete)
    for command in (find, call):
        help_ = "Type of the service (e.g. 'std_srvs/srv/Empty')"
        command.option('service_type', help_, SERVICES.complete_types)
    call.values('values', "Values of the request in YAML (e.g. '{a: 1, b: 2}')")
    call.option('-r --rate', 'Repeat the call at a specific rate in Hz', metavar='N', type=float)
    for command in (listing, info):
        command.graph_options()


def _list(args: argparse.Namespace) -> None:
    """Output a list of available services."""
    SERVICES.list(args)


def _type(args: argparse.Namespace) -> int:
    """Output a service's type."""
    return SERVICES.type(args, args.service_name)


def _find(args: argparse.Namespace) -> None:
    """Output a list of available services of a given type."""
    SERVICES.find(args, args.service_type)


def _info(args: argparse.Namespace) -> None:
    """Print information about a service."""
    name = args.service_name
    with graph(args, lambda node: name in SERVICES.types(node)) as opened:
        types = SERVICES.types(opened.node).get(name)
        if types is None:
            raise CommandError(f"Unknown service '{name}'")
        print(f'Type: {types[0] if len(types) == 1 else types}')
        print(f'Clients count: {opened.node.count_clients(name)}')
        print(f'Services count: {opened.node.count_services(name)}')


def _call(args: argparse.Namespace) -> None:
    """Call a service."""
    from helpers.ros2._values import filled, find_type

    if args.rate is not None and args.rate <= 0:
        raise CommandError('rate must be greater than zero')
    class_ = find_type(args.service_type, 'srv', 'The passed service type is invalid')
    request, _ = filled(class_.Request(), args.values, 'Failed to populate field: {}')
    with graph(args, name=f'_ros2cli_requester_{class_.__name__}') as opened:
        client = opened.node.create_client(class_, args.service_name)
        if not client.wait_for_service(0.1):
            print('waiting for service to become available...')
            client.wait_for_service()
        while True:
            print(f'requester: making request: {request!r}\n')
            called = time.monotonic()
            response = opened.result(client.call_async(request), 'calling service')
            print(f'response:\n{response!r}\n')
            if args.rate is None:
                break
            time.sleep(max(0.0, called + 1.0 / args.rate - time.monotonic()))
