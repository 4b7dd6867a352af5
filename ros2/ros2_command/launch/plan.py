"""What a launch file starts, worked out before anything starts."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from ros2_command.commands import CommandError
from ros2_command.index import command_of
from ros2_command.launch.elements import Element, read
from ros2_command.launch.substitutions import Scope, is_true, share_of


@dataclass
class Process:
    """What a `node` or an `executable` starts."""

    name: str
    command: list[str]
    environment: dict[str, str]
    output: str
    respawn: bool
    respawn_delay: float  # in seconds
    respawn_max_retries: int
    required: bool  # all ends with it
    sigterm_timeout: str  # in seconds, as it was given
    sigkill_timeout: str


def work_out(elements: Iterable[Element], scope: Scope) -> Iterator[Process]:
    """Yield what elements start. They may change the scope.

    Raises CommandError, with the line, if something cannot be worked out.
    """
    for element in elements:
        try:
            yield from _processes_of(element, scope)
        except (ValueError, OSError, RecursionError) as error:  # it may include itself
            element.fail(f'{error}.')


def _processes_of(element: Element, scope: Scope) -> Iterator[Process]:
    def text(name: str, default: str | None = None) -> str | None:
        value = element.attributes.get(name)
        return default if value is None else scope.text(str(value))

    if {'if', 'unless'} <= element.attributes.keys():
        raise ValueError("an entry has 'if' or 'unless', not both")
    if not is_true(text('if', '1')) or is_true(text('unless', '0')):
        return
    match element.tag:
        case 'arg':
            name, default = text('name'), text('default')
            if default is None and name not in scope.variables:
                raise ValueError(f"the argument '{name}' is missing: give it as {name}:=VALUE")
            scope.variables.setdefault(name, default)
        case 'let':
            scope.variables[text('name')] = text('value')
        case 'set_env':
            scope.environment[text('name')] = text('value')
        case 'push_ros_namespace' | 'push-ros-namespace':
            scope.namespace = _namespace(scope.namespace, text('namespace'))
        case 'group':
            inner = replace(
                scope, variables=scope.variables.copy(), environment=scope.environment.copy()
            )
            yield from work_out(element.children, inner)
        case 'include':
            # As in the real command: what an included file sets is known after it.
            scope.variables.update(scope.texts(element.children, 'name', 'value'))
            outer, path = scope.file, Path(text('file'))
            if not path.is_file():
                raise ValueError(f"the file '{path}' is not there")
            scope.file = str(path)
            yield from work_out(read(path).children, scope)
            scope.file = outer
        case _:
            yield _process(element, scope, text)


def _namespace(base: str | None, name: str | None) -> str | None:
    """Return a namespace below another one."""
    if name is None:
        return base
    whole = name if name.startswith('/') else f'{(base or "").rstrip("/")}/{name}'
    return whole.rstrip('/') or '/'


def _process(element: Element, scope: Scope, text: Callable[..., Any]) -> Process:
    if element.tag == 'node':
        command = _executable(text('exec'), text('pkg'))
        name = os.path.basename(command[-1])
        command += scope.words(element.attributes.get('args', ''))
        command += ['--ros-args', *_ros_arguments(element, scope, text)]
    else:
        command = scope.words(element.attributes['cmd'])
        if not command:
            raise ValueError('there is no command')
        name = text('name', os.path.basename(command[0]))
    output = text('output', 'log')
    if output not in ('screen', 'log', 'both'):
        raise ValueError(f"no output is called '{output}'")
    on_exit = text('on_exit')
    if on_exit not in (None, 'shutdown'):
        raise ValueError(f"'on_exit' must be 'shutdown', not '{on_exit}'")
    return Process(
        name=name,
        command=command,
        environment=scope.environment | dict(scope.texts(element.parts('env'), 'name', 'value')),
        output=output,
        respawn=is_true(text('respawn', '0')),
        respawn_delay=float(text('respawn_delay', '0')),
        respawn_max_retries=int(text('respawn_max_retries', '-1')),
        required=on_exit is not None,
        sigterm_timeout=_timeout('sigterm_timeout', scope),
        sigkill_timeout=_timeout('sigkill_timeout', scope),
    )


def _timeout(name: str, scope: Scope) -> str:
    """Return how many seconds a process has until a stronger signal comes."""
    seconds = scope.variables.get(name, '5')
    float(seconds)  # or it is a ValueError now, not when something must end
    return seconds


def _executable(name: str, package: str | None) -> list[str]:
    """Return the command of an executable. Raises ValueError if the package has none."""
    if package is None:
        return [name]
    folder = share_of(package).parents[1] / 'lib' / package
    try:
        return command_of(package, name)
    except CommandError:
        missing = f"executable '{name}' not found on the libexec directory '{folder}'"
        raise ValueError(missing) from None


def _ros_arguments(element: Element, scope: Scope, text: Callable[..., Any]) -> Iterator[str]:
    """Yield what comes behind `--ros-args`."""
    name, namespace = text('name'), _namespace(scope.namespace, text('namespace'))
    if name is not None:
        if not re.fullmatch(r'[A-Za-z_]\w*', name):
            raise ValueError(f"'{name}' is no name of a node: it needs letters, digits and _")
        yield from ('-r', f'__node:={name}')
    if namespace is not None:
        yield from ('-r', f'__ns:={namespace}')
    node = '/**' if None in (name, namespace) else f'{namespace.rstrip("/")}/{name}'
    for param in element.parts('param'):
        try:
            yield from ('--params-file', _parameter_file(param, scope, node))
        except (ValueError, OSError) as error:
            param.fail(f'{error}.')
    for before, after in scope.texts(element.parts('remap'), 'from', 'to'):
        yield from ('-r', f'{before}:={after}')


def _parameter_file(param: Element, scope: Scope, node: str) -> str:
    """Return the path of a file with parameters: that of `from`, or one that is written here."""
    given = param.attributes
    if 'from' in given:
        path = Path(scope.text(given['from']))
        path.open().close()  # it can be read
        return str(path)
    if not {'name', 'value'} <= given.keys():
        param.fail("'param' needs 'from', or 'name' and 'value'.")
    parameters = {scope.text(given['name']): _value(given['value'], param, scope)}
    with tempfile.NamedTemporaryFile('w', prefix='launch_params_', delete=False) as file:
        yaml.dump({node: {'ros__parameters': parameters}}, file)
    scope.written.append(file.name)
    return file.name


def _value(value: Any, param: Element, scope: Scope) -> Any:
    """Return the value of a parameter. A text in XML, or with a substitution, is read as YAML."""
    if isinstance(value, list):
        return [_value(item, param, scope) for item in value]
    has_type = param.file.endswith(('yaml', 'yml'))
    if not isinstance(value, str) or (has_type and '$(' not in value):
        return value
    text = scope.text(value)
    if (kind := param.attributes.get('type')) == 'str':
        return text
    if kind is not None:
        param.fail(f"'{kind}' is not a type that is read here: it can be str, or left out.")
    try:
        parsed = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return parsed if isinstance(parsed, bool | int | float | str | list) else text
