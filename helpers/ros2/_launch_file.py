"""Launch files in XML and YAML: read, checked, and worked out to the processes they start."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import tempfile
import xml.parsers.expat
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn

import yaml

from helpers.ros2 import _substitutions as subs
from helpers.ros2._errors import CommandError

PROCESS = (
    'output cwd respawn respawn_delay respawn_max_retries sigterm_timeout sigkill_timeout '
    'on_exit launch-prefix'
)
# The attributes of each tag (`!`: it must be there), then the children that are no actions.
# `*`: its children are actions, and each of those may have `if` or `unless`.
TAGS = {
    'arg': 'name! default description | choice',
    'let': 'name! value!',
    'node': f'exec! pkg name namespace args ros_args exec_name {PROCESS} | param remap env',
    'executable': f'cmd! name shell {PROCESS} | env',
    'group': 'scoped forwarding | * keep',
    'include': 'file! | arg let',
    'push_ros_namespace': 'namespace!',
    'push-ros-namespace': 'namespace!',
    'set_env': 'name! value!',
    'unset_env': 'name!',
    'set_parameter': 'name! value!',
    'set_remap': 'from! to!',
    'log': 'message!',
    'timer': 'period! | *',
}
INNER = {
    'param': 'name value type from allow_substs | param',
    'remap': 'from! to!',
    'choice': 'value!',
    **dict.fromkeys(('env', 'keep', 'arg', 'let'), 'name! value!'),
}
# What is no text in YAML. All else is: the real command refuses `default: 2`, too.
TYPES = {
    **dict.fromkeys(('respawn_delay', 'sigterm_timeout', 'sigkill_timeout'), float),
    **dict.fromkeys(('scoped', 'forwarding', 'shell', 'allow_substs'), bool),
    'respawn_max_retries': int,
    'version': int,
}
LISTS = {f'list_of_{kind.__name__}': kind for kind in (str, int, float, bool)}
PYTHON = {
    'Node': 'node',
    'ExecuteProcess': 'executable',
    'DeclareLaunchArgument': 'arg',
    'IncludeLaunchDescription': 'include',
    'GroupAction': 'group',
    'TimerAction': 'timer',
    'PushROSNamespace': 'push_ros_namespace',
    'PushRosNamespace': 'push_ros_namespace',
    'SetEnvironmentVariable': 'set_env',
    'SetLaunchConfiguration': 'let',
}


@dataclass
class Element:
    """A tag of a launch file, and where it is written."""

    tag: str
    file: str
    line: int
    attributes: dict[str, Any] = field(default_factory=dict)
    children: list[Element] = field(default_factory=list)

    def fail(self, sentence: str) -> NoReturn:
        """Raise CommandError with the file and the line before the sentence."""
        raise CommandError(f'{self.file}:{self.line}: {sentence}')

    def inner(self, tag: str) -> list[Element]:
        """The children of a tag."""
        return [child for child in self.children if child.tag == tag]


@dataclass
class Process:
    """What a `node` or an `executable` starts. Times are in seconds."""

    name: str
    command: list[str]
    environment: dict[str, str]
    cwd: str | None
    shell: bool
    output: str
    respawn: bool
    respawn_delay: float
    respawn_max_retries: int
    sigterm_timeout: str
    sigkill_timeout: str
    required: bool  # all ends with it


@dataclass
class Timer:
    """What is started after a time, in seconds."""

    period: float
    then: Callable[[], Iterator]


# --- reading ---


def read(path: Path) -> Element:
    """Read a launch file, and check its tags and attributes.

    Raises CommandError, with the line, if something in it is wrong.
    """
    try:
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise CommandError(f"the launch file '{path}' cannot be read: {error}") from None
    if path.suffix == '.py':
        used = [f'{name} is <{tag}>' for name, tag in PYTHON.items() if f'{name}(' in text]
        raise CommandError(
            f"'{path}' is a Python launch file, which a full ROS 2 runs; this command reads XML "
            f'and YAML, in which {", ".join(used) or "Node is <node>"}.'
        )
    is_xml = path.suffix == '.xml' or text.lstrip().startswith('<')
    root = (_read_xml if is_xml else _read_yaml)(text, str(path))
    if root.tag != 'launch':
        root.fail(f"a launch file begins with 'launch', not with '{root.tag}'.")
    _check(root, 'version | *', is_xml)
    return root


def _read_xml(text: str, file: str) -> Element:
    parser = xml.parsers.expat.ParserCreate()
    stack = [Element('', file, 1)]

    def start(tag: str, attributes: dict[str, str]) -> None:
        stack.append(Element(tag, file, parser.CurrentLineNumber, attributes))
        stack[-2].children.append(stack[-1])

    def characters(data: str) -> None:
        if data.strip():
            stack[-1].line = parser.CurrentLineNumber
            stack[-1].fail(f"the text '{data.strip()}' is in no attribute.")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: stack.pop()
    parser.CharacterDataHandler = characters
    try:
        parser.Parse(text, True)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        Element('', file, error.lineno).fail(f'this is no valid XML: {reason}.')
    return stack[0].children[0]


def _read_yaml(text: str, file: str) -> Element:
    def element(tag: str, node: yaml.Node, line: int) -> Element:
        new = Element(tag, file, line + 1)
        if isinstance(node, yaml.SequenceNode):
            new.children = [action(item) for item in node.value]
        elif not isinstance(node, yaml.MappingNode):
            new.fail(f"'{tag}' needs its attributes below it.")
        for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
            name, is_list = str(key.value), isinstance(value, yaml.SequenceNode)
            if is_list and name == 'children':
                new.children += [action(item) for item in value.value]
            elif is_list and name in INNER:
                items = [element(name, item, item.start_mark.line) for item in value.value]
                new.children += items
            elif name in INNER and isinstance(value, yaml.MappingNode):
                new.fail(f"'{name}' must be a list: write `- ` before it, below '{name}:'.")
            else:
                new.attributes[name] = loader.construct_object(value, deep=True)
        return new

    def action(node: yaml.Node) -> Element:
        if not isinstance(node, yaml.MappingNode) or len(node.value) != 1:
            line = node.start_mark.line + 1 if node else 1
            Element('', file, line).fail('an action is one key, such as `node:`, and its value.')
        key, value = node.value[0]
        return element(str(key.value), value, key.start_mark.line)

    try:
        loader = yaml.SafeLoader(text)
        return action(loader.get_single_node())
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        reason = getattr(error, 'problem', None) or 'it has a character that is not allowed'
        Element('', file, mark.line + 1 if mark else 1).fail(f'no valid YAML: {reason}.')


def _check(element: Element, rule: str, is_xml: bool) -> None:
    """Check the attributes of an element, and all that is below it."""
    tag = f'<{element.tag}>' if is_xml else f"'{element.tag}'"
    own, _, below = rule.partition('|')
    names = {name.rstrip('!'): name.endswith('!') for name in own.split()}
    for name, value in element.attributes.items():
        if name not in names:
            element.fail(f"{tag} has no attribute '{name}'; it has {', '.join(names)}.")
        kind = TYPES.get(name, str)
        if is_xml and kind in (int, float):
            with contextlib.suppress(ValueError):
                value = element.attributes[name] = kind(value)
        kinds = (kind, str) if kind is bool else (kind,)
        if type(value) not in kinds and (element.tag, name) != ('param', 'value'):
            wanted = f'"{value}", a text in quotes' if kind is str else f'a {kind.__name__}'
            element.fail(f"'{name}' of {tag} must be {wanted}, also for the real command.")
    for name in names:
        if names[name] and name not in element.attributes:
            element.fail(f"{tag} needs the attribute '{name}'.")
    inner = {name: INNER[name] for name in below.replace('*', '').split()}
    actions = {name: f'if unless {rule}' for name, rule in TAGS.items() if '*' in below}
    for child in element.children:
        if child.tag not in inner | actions:
            known = ', '.join(actions | inner)
            child.fail(f"{tag} has no '{child.tag}'; it has {known or 'only attributes'}.")
        _check(child, (inner | actions)[child.tag], is_xml)


# --- working out ---


@dataclass
class Scope:
    """What is known at a place of a launch file."""

    file: str
    variables: dict[str, str]
    environment: dict[str, str]
    written: list[str]  # files of parameters, of all scopes
    namespace: str | None = None
    parameters: tuple[tuple[str, Any], ...] = ()
    remaps: tuple[tuple[str, str], ...] = ()

    def copy(self) -> Scope:
        """A scope that knows the same, and what changes there does not change here."""
        variables, environment = self.variables.copy(), self.environment.copy()
        return replace(self, variables=variables, environment=environment)

    def text(self, text: str) -> str:
        """A text with its substitutions performed. Raises ValueError if one fails."""
        return subs.perform(subs.parse(text), self)

    def texts(self, elements: Iterable[Element], *names: str) -> list[tuple[str, ...]]:
        """These attributes of elements."""
        return [tuple(self.text(e.attributes[name]) for name in names) for e in elements]


def work_out(elements: Iterable[Element], scope: Scope) -> Iterator[Process | Timer | str]:
    """Yield what elements start, or the message of a `log`. They may change the scope.

    Raises CommandError, with the line, if something cannot be worked out.
    """
    for element in elements:
        try:
            yield from _one(element, scope)
        except (ValueError, OSError, RecursionError) as error:  # it may include itself
            element.fail(f'{error}.')


def _one(element: Element, scope: Scope) -> Iterator[Process | Timer | str]:
    def text(name: str, default: str | None = None) -> str | None:
        value = element.attributes.get(name)
        return default if value is None else scope.text(str(value))

    if {'if', 'unless'} <= element.attributes.keys():
        raise ValueError("an action has 'if' or 'unless', not both")
    if not subs.is_true(text('if', '1')) or subs.is_true(text('unless', '0')):
        return
    match element.tag:
        case 'arg':
            name, default = text('name'), text('default')
            if default is None and name not in scope.variables:
                raise ValueError(f"the argument '{name}' is missing: give it as {name}:=VALUE")
            value = scope.variables.setdefault(name, default)
            choices = [child.attributes['value'] for child in element.children]
            if choices and value not in choices:
                raise ValueError(
                    f'Argument "{name}" provided value "{value}" is not valid. '
                    f'Valid options are: {choices}'
                )
        case 'let':
            scope.variables[text('name')] = text('value')
        case 'set_env':
            scope.environment[text('name')] = text('value')
        case 'unset_env':
            scope.environment.pop(text('name'), None)
        case 'push_ros_namespace' | 'push-ros-namespace':
            scope.namespace = _namespace(scope.namespace, text('namespace'))
        case 'set_parameter':
            scope.parameters += ((text('name'), _typed(text('value'))),)
        case 'set_remap':
            scope.remaps += ((text('from'), text('to')),)
        case 'log':
            yield text('message')
        case 'timer':
            later = scope.copy()
            yield Timer(float(text('period')), lambda: work_out(element.children, later))
        case 'group':
            inside = scope.copy() if subs.is_true(text('scoped', '1')) else scope
            kept = dict(scope.texts(element.inner('keep'), 'name', 'value'))
            if inside is not scope and not subs.is_true(text('forwarding', '1')):
                inside = Scope(scope.file, {}, dict(os.environ), scope.written)
            inside.variables.update(kept)
            yield from work_out((c for c in element.children if c.tag != 'keep'), inside)
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
    """A namespace below another one. Raises ValueError if it is no valid one."""
    if name is None:
        return base
    whole = name if name.startswith('/') else f'{(base or "").rstrip("/")}/{name}'
    whole = whole.rstrip('/') or '/'
    if not re.fullmatch(r'/|(/[A-Za-z_]\w*)+', whole):
        raise ValueError(f"'{whole}' is no namespace: it needs names of letters, digits and _")
    return whole


def _process(element: Element, scope: Scope, text: Callable[..., Any]) -> Process:
    def command(name: str) -> list[str]:
        words = subs.words(subs.parse(element.attributes.get(name, '')))
        return [subs.perform(word, scope) for word in words]

    if element.tag == 'node':
        program = text('exec')
        start = subs.executable(program, text('pkg')) if text('pkg') else [program]
        name = text('exec_name', os.path.basename(start[-1]))
        start += command('args') + ['--ros-args'] * ('ros_args' in element.attributes)
        start += [*command('ros_args'), '--ros-args', *_ros_arguments(element, scope, text)]
    else:
        start = command('cmd')
        name = text('name', os.path.basename([*start, ''][0]))
    output = os.environ.get('OVERRIDE_LAUNCH_PROCESS_OUTPUT', text('output', 'log'))
    if not start or output not in ('screen', 'log', 'both'):
        raise ValueError('there is no command' if not start else f"no output is called '{output}'")
    timeouts = {
        name: text(name, scope.variables.get(name, '5'))
        for name in ('sigterm_timeout', 'sigkill_timeout')
    }
    delay = float(text('respawn_delay', '0'))
    if min(delay, *map(float, timeouts.values())) < 0:
        raise ValueError('a time is negative')
    if text('on_exit') not in (None, 'shutdown'):
        raise ValueError(f"'on_exit' can be shutdown, not '{text('on_exit')}'")
    prefix = shlex.split(text('launch-prefix', scope.variables.get('launch-prefix', '')))
    return Process(
        name=name,
        command=prefix + start,
        environment=scope.environment | dict(scope.texts(element.inner('env'), 'name', 'value')),
        cwd=text('cwd'),
        shell=subs.is_true(text('shell', '0')),
        output=output,
        respawn=subs.is_true(text('respawn', '0')),
        respawn_delay=delay,
        respawn_max_retries=int(text('respawn_max_retries', '-1')),
        required=text('on_exit') is not None,
        **timeouts,
    )


def _ros_arguments(element: Element, scope: Scope, text: Callable[..., Any]) -> Iterator[str]:
    name, namespace = text('name'), _namespace(scope.namespace, text('namespace'))
    if name is not None:
        if not re.fullmatch(r'[A-Za-z_]\w*', name):
            raise ValueError(f"'{name}' is no name of a node: it needs letters, digits and _")
        yield from ('-r', f'__node:={name}')
    if namespace is not None:
        yield from ('-r', f'__ns:={namespace}')
    for key, value in scope.parameters:
        yield from ('-p', f'{key}:={value}')
    node = '/**' if None in (name, namespace) else f'{namespace.rstrip("/")}/{name}'
    for param in element.inner('param'):
        try:
            yield from ('--params-file', _parameter_file(param, scope, node))
        except (ValueError, OSError) as error:
            param.fail(f'{error}.')
    for before, after in (*scope.remaps, *scope.texts(element.inner('remap'), 'from', 'to')):
        yield from ('-r', f'{before}:={after}')


def _parameter_file(element: Element, scope: Scope, node: str) -> str:
    """The path of a file with parameters: the one that `from` names, or one that is written."""
    if source := element.attributes.get('from'):
        path = Path(scope.text(source))
        content = path.read_text(encoding='utf-8')
        if not subs.is_true(scope.text(str(element.attributes.get('allow_substs', '0')))):
            return str(path)
        content = scope.text(content)
    else:
        content = yaml.dump({node: {'ros__parameters': _parameters(element, scope)}})
    with tempfile.NamedTemporaryFile('w', prefix='launch_params_', delete=False) as file:
        file.write(content)
    scope.written.append(file.name)
    return file.name


def _parameters(element: Element, scope: Scope, before: str = '') -> dict[str, Any]:
    """The parameters of a `param` and of those nested in it, with dots in their names."""
    given, parameters = element.attributes, {}
    if 'name' not in given or ('value' in given) == bool(element.children):
        element.fail("'param' needs 'from', or 'name' and then 'value' or parameters in it.")
    name, value, kind = before + scope.text(given['name']), given.get('value'), given.get('type')
    for child in element.children:
        parameters |= _parameters(child, scope, f'{name}.')
    if element.children:
        return parameters
    whole = isinstance(value, str) and '$(' in value and not value.lstrip().startswith('[')
    if (
        isinstance(value, str)
        and not whole
        and (kind or not element.file.endswith(('yaml', 'yml')))
    ):
        value = _typed(value, kind)
    items = [
        item
        if not isinstance(item, str)
        else _typed(scope.text(item), kind if whole else None)
        if '$(' in item
        else scope.text(item)
        for item in (value if isinstance(value, list) else [value])
    ]
    if len({type(item) for item in items}) != 1:
        raise ValueError(f"the parameter '{name}' is a list of several types, or an empty one")
    return {name: items if isinstance(value, list) else items[0]}


def _typed(text: str, kind: str | None = None) -> Any:
    """The value of a text, by the rules of YAML if it has no type. Raises ValueError."""
    if kind == 'str' or not text:
        return text
    if kind == 'bool':
        return subs.is_true(text)
    try:
        if kind in ('int', 'float'):
            return {'int': int, 'float': float}[kind](text)
        value = yaml.safe_load(text)
    except (ValueError, yaml.YAMLError):
        raise ValueError(f"'{text}' is no {kind or 'value'}: a text can have type='str'") from None
    items = value if isinstance(value, list) else [value]
    kinds = {LISTS[kind]} if kind in LISTS else {bool, int, float, str}
    if {type(item) for item in items} - kinds or (kind in LISTS and items is not value):
        raise ValueError(f"'{text}' is no {kind or 'bool, int, float, text or list of them'}")
    return value
