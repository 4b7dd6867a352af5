"""Various param related sub-commands."""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import Any

import yaml
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import (
    get_parameter_value,
    parameter_dict_from_yaml_file,
    parameter_value_to_python,
)
from yaml import YAMLError

from ros2_command.commands import CommandError, command, option
from ros2_command.graph import Graph, graph
from ros2_command.names import NODE, NODE_OR_ALL, graph_with_node, node_names, split_node_name

TYPES = (
    *('not set', 'boolean', 'integer', 'double', 'string', 'byte array', 'boolean array'),
    *('integer array', 'double array', 'string array'),
)

NAME = option('parameter_name', 'Name of the parameter')
NAMES = option('parameter_names', 'Names of the parameters', nargs='+')


def _names(opened: Graph, node: str) -> list[str]:
    return sorted(opened.call(node, ListParameters).result.names)


def _values(opened: Graph, node: str, names: list[str]) -> list[tuple[Any, str]]:
    """Return the value of each parameter, and its type."""
    values = opened.call(node, GetParameters, names=names).values
    return [(parameter_value_to_python(value), TYPES[value.type]) for value in values]


def _set_all(opened: Graph, node: str, parameters: list, sentences: list[tuple[str, str]]) -> None:
    """Set parameters. `sentences` has for each the one for success and the one for failure."""
    results = opened.call(node, SetParameters, parameters=parameters).results
    for (success, failure), result in zip(sentences, results, strict=True):
        reason = f': {result.reason}' if result.reason else ''
        if result.successful:
            print(f'{success}{reason}')
        else:  # the real command's status is 0 nevertheless
            print(f'{failure}{reason}', file=sys.stderr)


@command(NODE_OR_ALL)
def _list(args: argparse.Namespace) -> None:
    """Output a list of available parameters."""
    if args.node_name:
        with graph_with_node(args.node_name) as (opened, node):
            print(*(f'  {name}' for name in _names(opened, node)), sep='\n')
        return
    with graph() as opened:
        for node in sorted(node_names(opened.node), key=split_node_name):
            try:
                print(f'{node}:', *(f'  {name}' for name in _names(opened, node)), sep='\n')
            except CommandError as error:
                print(error, file=sys.stderr)


@command(NODE, NAME)
def _get(args: argparse.Namespace) -> None:
    """Get parameter."""
    with graph_with_node(args.node_name) as (opened, node):
        values = _values(opened, node, [args.parameter_name])
    if not values:
        raise CommandError('Parameter not set')
    [(value, type_)] = values
    if value is None:
        print('Parameter not set.')
    elif type_.endswith(' array'):
        print(f'{type_.removesuffix(" array").capitalize()} values are: {value}')
    else:
        print(f'{type_.capitalize()} value is: {value}')


@command(NODE, NAME, option('value', 'Value of the parameter'))
def _set(args: argparse.Namespace) -> None:
    """Set parameter."""
    value = None
    with contextlib.suppress(yaml.YAMLError, AssertionError):  # the second, if fields are checked
        value = get_parameter_value(args.value)
    if value is None or not isinstance(value.string_value, str):  # but a dict
        raise CommandError(f"'{args.value}' is no value of a parameter: put a text in quotes")
    _set_one(args, value, 'Set parameter successful', 'Setting parameter failed')


@command(NODE, NAME)
def _delete(args: argparse.Namespace) -> None:
    """Delete parameter."""
    success, failure = 'Deleted parameter successfully', 'Deleting parameter failed'
    _set_one(args, ParameterValue(), success, failure)


def _set_one(args: argparse.Namespace, value: Any, success: str, failure: str) -> None:
    parameter = Parameter(name=args.parameter_name, value=value)
    with graph_with_node(args.node_name) as (opened, node):
        _set_all(opened, node, [parameter], [(success, failure)])


@command(NODE, NAMES)
def _describe(args: argparse.Namespace) -> None:
    """Show descriptive information about declared parameters."""
    with graph_with_node(args.node_name) as (opened, node):
        answer = opened.call(node, DescribeParameters, names=args.parameter_names)
    for descriptor in answer.descriptors:
        print(f'Parameter name: {descriptor.name}\n  Type: {TYPES[descriptor.type]}')
        if descriptor.description:
            print(f'  Description: {descriptor.description}')
        print('  Constraints:')
        if descriptor.read_only:
            print('    Read only: true')
        for range_ in [*descriptor.floating_point_range, *descriptor.integer_range]:
            print(f'    Min value: {range_.from_value}\n    Max value: {range_.to_value}')
            if range_.step:
                print(f'    Step: {range_.step}')
        if descriptor.additional_constraints:
            print(f'    Additional constraints: {descriptor.additional_constraints}')


@command(NODE)
def _dump(args: argparse.Namespace) -> None:
    """Show all of the parameters of a node in a YAML file format."""
    with graph_with_node(args.node_name) as (opened, node):
        names = _names(opened, node)
        values = _values(opened, node, names)
    tree: dict = {}
    for name, (value, _) in zip(names, values, strict=True):
        *groups, last = name.split('.')
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[last] = value
    print(yaml.dump({node: {'ros__parameters': tree}}, default_flow_style=False))


@command(NODE, option('parameter_file', 'Parameter file'))
def _load(args: argparse.Namespace) -> None:
    """Load parameter file for a node."""
    try:
        parameters = parameter_dict_from_yaml_file(args.parameter_file, use_wildcard=True)
    except (OSError, RuntimeError, YAMLError, AttributeError, TypeError) as error:
        sentence = ' '.join(str(error).split())
        raise CommandError(f'Cannot load {args.parameter_file}: {sentence}') from None
    sentences = [
        (f'Set parameter {name} successful', f'Set parameter {name} failed') for name in parameters
    ]
    with graph_with_node(args.node_name) as (opened, node):
        _set_all(opened, node, list(parameters.values()), sentences)
