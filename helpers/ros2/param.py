"""Various param related sub-commands."""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import Graph, graph
from helpers.ros2._names import complete_nodes, graph_with_node, node_names, split_node_name

TYPES = (
    *('not set', 'boolean', 'integer', 'double', 'string', 'byte array', 'boolean array'),
    *('integer array', 'double array', 'string array'),
)


def add_arguments(parser: Parser) -> None:
    """Add the commands below `ros2 param`."""
    commands = parser.functions(_list, _get, _set, _describe, _dump, _load, _delete)
    listing, get, set_, describe, dump, load, delete = commands
    for command in commands:
        command.graph_options()
        command.flag('--include-hidden-nodes', 'Consider hidden nodes as well')
        nargs = '?' if command is listing else None
        command.option('node_name', 'Name of the ROS node', complete_nodes, nargs=nargs)
        if command is not listing:
            help_ = 'Wait for N seconds until node becomes available (default 1 sec)'
            command.option('--timeout', help_, metavar='N', type=int, default=1)
    listing.option('--filter', 'Only parameters that match this regular expression')
    listing.option('--param-prefixes', 'Only with one of these prefixes', nargs='+', default=[])
    listing.flag('--param-type', 'Print parameter types with parameter names')
    for command in (get, set_, delete):
        command.option('parameter_name', 'Name of the parameter', _complete)
    get.flag('--hide-type', 'Hide the type information')
    set_.option('value', 'Value of the parameter')
    describe.option('parameter_names', 'Names of the parameters', _complete, nargs='+')
    load.option('parameter_file', 'Parameter file')
    load.flag('--no-use-wildcard', "Do not load parameters in the '/**' namespace")


def _complete(parsed_args: argparse.Namespace, **kwargs: Any) -> list[str]:
    with graph_with_node(parsed_args) as (opened, node):
        return _names(opened, node)


def _call(opened: Graph, node: str, service: str, **fields: Any) -> Any:
    """Call a parameter service, for example `GetParameters`, and return its response."""
    from rcl_interfaces import srv

    name = re.sub('(?<!^)(?=[A-Z])', '_', service).lower()
    return opened.call(getattr(srv, service), f'{node}/{name}', **fields)


def _names(opened: Graph, node: str, prefixes: Sequence[str] = ()) -> list[str]:
    return sorted(_call(opened, node, 'ListParameters', prefixes=list(prefixes)).result.names)


def _values(opened: Graph, node: str, names: list[str]) -> list:
    return list(_call(opened, node, 'GetParameters', names=names).values)


def _python(value: Any) -> Any:
    from rclpy.parameter import parameter_value_to_python

    found = parameter_value_to_python(value)
    return found.tolist() if hasattr(found, 'tolist') else found


def _list(args: argparse.Namespace) -> None:
    """Output a list of available parameters."""
    try:
        keep = re.compile(args.filter or '').match
    except re.error as error:
        raise CommandError(f'--filter is not a regular expression: {error}') from None
    with contextlib.ExitStack() as stack:
        if args.node_name:
            opened, name = stack.enter_context(graph_with_node(args))
            nodes = [name]
        else:
            opened = stack.enter_context(graph(args))
            names = node_names(opened.node, args.include_hidden_nodes)
            nodes = sorted(names, key=split_node_name)
        for node in nodes:
            try:
                names = [n for n in _names(opened, node, args.param_prefixes) if keep(n)]
            except CommandError as error:
                print(error, file=sys.stderr)
                continue
            if not args.node_name and names:
                print(f'{node}:')
            found = args.param_type and _call(opened, node, 'DescribeParameters', names=names)
            types = [f' (type: {TYPES[d.type]})' for d in found.descriptors] if found else []
            for name, type_ in zip_longest(names, types, fillvalue=''):
                print(f'  {name}{type_}')


def _get(args: argparse.Namespace) -> None:
    """Get parameter."""
    with graph_with_node(args) as (opened, node):
        values = _values(opened, node, [args.parameter_name])
    if not values:
        raise CommandError('Parameter not set')
    value, type_ = _python(values[0]), TYPES[values[0].type]
    if args.hide_type:
        print(value)
    elif value is None:
        print('Parameter not set.')
    elif type_.endswith(' array'):
        print(f'{type_.removesuffix(" array").capitalize()} values are: {value}')
    else:
        print(f'{type_.capitalize()} value is: {value}')


def _set(args: argparse.Namespace) -> None:
    """Set parameter."""
    from rclpy.parameter import get_parameter_value

    _set_values(args, get_parameter_value(args.value), 'Set parameter', 'Setting parameter')


def _delete(args: argparse.Namespace) -> None:
    """Delete parameter."""
    from rcl_interfaces.msg import ParameterValue

    _set_values(args, ParameterValue(), 'Deleted parameter', 'Deleting parameter')


def _set_values(args: argparse.Namespace, value: Any, done: str, doing: str) -> None:
    from rcl_interfaces.msg import Parameter

    parameter = Parameter(name=args.parameter_name, value=value)
    with graph_with_node(args) as (opened, node):
        [result] = _call(opened, node, 'SetParameters', parameters=[parameter]).results
    word = 'successfully' if done.startswith('Deleted') else 'successful'
    _say(result, f'{done} {word}', f'{doing} failed')


def _say(result: Any, done: str, failed: str) -> None:
    reason = f': {result.reason}' if result.reason else ''
    if result.successful:
        print(f'{done}{reason}')
    else:  # the real command's status is 0 nevertheless
        print(f'{failed}{reason}', file=sys.stderr)


def _describe(args: argparse.Namespace) -> None:
    """Show descriptive information about declared parameters."""
    with graph_with_node(args) as (opened, node):
        found = _call(opened, node, 'DescribeParameters', names=args.parameter_names).descriptors
    for descriptor in found:
        print(f'Parameter name: {descriptor.name}\n  Type: {TYPES[descriptor.type]}')
        if descriptor.description:
            print(f'  Description: {descriptor.description}')
        print('  Constraints:')
        if descriptor.read_only:
            print('    Read only: true')
        for range_ in [*descriptor.floating_point_range, *descriptor.integer_range][:1]:
            print(f'    Min value: {range_.from_value}\n    Max value: {range_.to_value}')
            if range_.step:
                print(f'    Step: {range_.step}')
        if descriptor.additional_constraints:
            print(f'    Additional constraints: {descriptor.additional_constraints}')


def _dump(args: argparse.Namespace) -> None:
    """Show all of the parameters of a node in a YAML file format."""
    import yaml

    with graph_with_node(args) as (opened, node):
        names = _names(opened, node)
        values = _values(opened, node, names)
    tree: dict = {}
    for name, value in zip(names, values, strict=True):
        *groups, last = name.split('.')
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[last] = _python(value)
    print(yaml.dump({node: {'ros__parameters': tree}}, default_flow_style=False))


def _load(args: argparse.Namespace) -> None:
    """Load parameter file for a node."""
    from rclpy.parameter import parameter_dict_from_yaml_file
    from yaml import YAMLError

    try:
        found = parameter_dict_from_yaml_file(args.parameter_file, not args.no_use_wildcard)
    except (OSError, RuntimeError, YAMLError, AttributeError, TypeError) as error:
        sentence = ' '.join(str(error).split())
        raise CommandError(f'Cannot load {args.parameter_file}: {sentence}') from None
    parameters = list(found.values())
    with graph_with_node(args) as (opened, node):
        results = _call(opened, node, 'SetParameters', parameters=parameters).results
    for parameter, result in zip(parameters, results, strict=True):
        what = f'Set parameter {parameter.name}'
        _say(result, f'{what} successful', f'{what} failed')
