"""Launch files in XML and YAML: read, checked, and worked out to the processes they start."""

from __future__ import annotations

import ast
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

from helpers.ros2 import _index
from helpers.ros2._commands import CommandError
from helpers.ros2.run import command_of

PROCESS = 'output respawn respawn_delay respawn_max_retries on_exit'
# What a mark stands for that splits no words, and that nobody types.
MARK = '\ue000'
# The attributes of each tag (`!`: it must be there), then the children that are no actions.
# `*`: its children are actions, and each of those may have `if` or `unless`.
TAGS = {
    'arg': 'name! default description',
    'let': 'name! value!',
    'node': f'exec! pkg name namespace args {PROCESS} | param remap env',
    'executable': f'cmd! name {PROCESS} | env',
    'group': '| *',
    'include': 'file! | arg let',
    'push_ros_namespace': 'namespace!',
    'push-ros-namespace': 'namespace!',
    'set_env': 'name! value!',
}
INNER = {
    'param': 'name value from',
    'remap': 'from! to!',
    **dict.fromkeys(('env', 'arg', 'let'), 'name! value!'),
}
NUMBERS = 'respawn_delay', 'respawn_max_retries', 'version'
PYTHON = {
    'Node': 'node',
    'ExecuteProcess': 'executable',
    'DeclareLaunchArgument': 'arg',
    'IncludeLaunchDescription': 'include',
    'GroupAction': 'group',
    'PushROSNamespace': 'push_ros_namespace',
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
    """What a `node` or an `executable` starts."""

    name: str
    command: list[str]
    environment: dict[str, str]
    output: str
    respawn: bool
    respawn_delay: float  # in seconds
    respawn_max_retries: int
    required: bool  # all ends with it
    sigterm_timeout: str  # in seconds
    sigkill_timeout: str


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
            if is_list and name in INNER:
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
            element.fail(f"{tag} has no attribute '{name}' here; it has {', '.join(names)}.")
        if not isinstance(value, str) and name not in NUMBERS and element.tag != 'param':
            wanted = f'"{value}", a text in quotes'
            element.fail(f"'{name}' of {tag} must be {wanted}, also for the real command.")
    for name in names:
        if names[name] and name not in element.attributes:
            element.fail(f"{tag} needs the attribute '{name}'.")
    inner = {name: INNER[name] for name in below.replace('*', '').split()}
    actions = {name: f'if unless {rule}' for name, rule in TAGS.items() if '*' in below}
    for child in element.children:
        if child.tag not in inner | actions:
            known = ', '.join(actions | inner)
            child.fail(f"{tag} has no '{child.tag}' here; it has {known or 'only attributes'}.")
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

    def text(self, text: str) -> str:
        """A text with its substitutions performed. Raises ValueError if one fails."""
        return expand(text, self)

    def texts(self, elements: Iterable[Element], *names: str) -> list[tuple[str, ...]]:
        """These attributes of elements."""
        return [tuple(self.text(e.attributes[name]) for name in names) for e in elements]


def work_out(elements: Iterable[Element], scope: Scope) -> Iterator[Process]:
    """Yield what elements start. They may change the scope.

    Raises CommandError, with the line, if something cannot be worked out.
    """
    for element in elements:
        try:
            yield from _one(element, scope)
        except (ValueError, OSError, RecursionError) as error:  # it may include itself
            element.fail(f'{error}.')


def _one(element: Element, scope: Scope) -> Iterator[Process]:
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
            copies = {name: getattr(scope, name).copy() for name in ('variables', 'environment')}
            yield from work_out(element.children, replace(scope, **copies))
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
    """A namespace below another one."""
    if name is None:
        return base
    whole = name if name.startswith('/') else f'{(base or "").rstrip("/")}/{name}'
    return whole.rstrip('/') or '/'


def _process(element: Element, scope: Scope, text: Callable[..., Any]) -> Process:
    if element.tag == 'node':
        command = _executable(text('exec'), text('pkg'))
        name = os.path.basename(command[-1])
        command += words(element.attributes.get('args', ''), scope)
        command += ['--ros-args', *_ros_arguments(element, scope, text)]
    else:
        command = words(element.attributes['cmd'], scope)
        name = text('name', os.path.basename([*command, ''][0]))
    output = text('output', 'log')
    if not command or output not in ('screen', 'log', 'both'):
        raise ValueError(f"no output is called '{output}'" if command else 'there is no command')
    if text('on_exit') not in (None, 'shutdown'):
        raise ValueError(f"'on_exit' must be 'shutdown', not '{text('on_exit')}'")
    return Process(
        name=name,
        command=command,
        environment=scope.environment | dict(scope.texts(element.inner('env'), 'name', 'value')),
        output=output,
        respawn=is_true(text('respawn', '0')),
        respawn_delay=float(text('respawn_delay', '0')),
        respawn_max_retries=int(text('respawn_max_retries', '-1')),
        required=text('on_exit') is not None,
        sigterm_timeout=scope.variables.get('sigterm_timeout', '5'),
        sigkill_timeout=scope.variables.get('sigkill_timeout', '5'),
    )


def _executable(name: str, package: str | None) -> list[str]:
    """The command of an executable. Raises ValueError if the package has none."""
    if package is None:
        return [name]
    folder = share_of(package).parents[1] / 'lib' / package
    try:
        return command_of(package, name)
    except CommandError:
        missing = f"executable '{name}' not found on the libexec directory '{folder}'"
        raise ValueError(missing) from None


def _ros_arguments(element: Element, scope: Scope, text: Callable[..., Any]) -> Iterator[str]:
    name, namespace = text('name'), _namespace(scope.namespace, text('namespace'))
    if name is not None:
        if not re.fullmatch(r'[A-Za-z_]\w*', name):
            raise ValueError(f"'{name}' is no name of a node: it needs letters, digits and _")
        yield from ('-r', f'__node:={name}')
    if namespace is not None:
        yield from ('-r', f'__ns:={namespace}')
    node = '/**' if None in (name, namespace) else f'{namespace.rstrip("/")}/{name}'
    for param in element.inner('param'):
        try:
            yield from ('--params-file', _parameter_file(param, scope, node))
        except (ValueError, OSError) as error:
            param.fail(f'{error}.')
    for before, after in scope.texts(element.inner('remap'), 'from', 'to'):
        yield from ('-r', f'{before}:={after}')


def _parameter_file(param: Element, scope: Scope, node: str) -> str:
    """The path of a file with parameters: the one that `from` names, or one that is written."""
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
    """The value of a parameter. A text in XML, or with a substitution, is read as YAML."""
    if isinstance(value, list):
        return [_value(item, param, scope) for item in value]
    if not isinstance(value, str) or ('$(' not in value and param.file.endswith(('yaml', 'yml'))):
        return value
    text = scope.text(value)
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return found if isinstance(found, bool | int | float | str | list) else text


# --- substitutions ---


def expand(text: str, scope: Any, keep: Callable[[str], str] = str) -> str:
    """A text with its substitutions performed, and what `keep` makes of each value.

    Raises ValueError if it is malformed, or if a substitution fails.
    """
    return _expand(text, 0, '', scope, keep)[0]


def words(text: str, scope: Any) -> list[str]:
    """Split a command at its spaces, but not in quotes, nor where a substitution has some."""
    values: list[str] = []
    marked = expand(text, scope, lambda value: values.append(value) or MARK)
    return [re.sub(MARK, lambda _: values.pop(0), word) for word in shlex.split(marked)]


def _expand(
    text: str, at: int, stop: str, scope: Any, keep: Callable[[str], str] = str
) -> tuple[str, int]:
    """The text from a position to one of the characters `stop`, and where that is."""
    found = ''
    while at < len(text) and text[at] not in stop:
        if text.startswith('$(', at):
            value, at = _substitute(text, at + 2, scope)
            found += keep(value)
        else:
            at += text[at] == '\\' and at + 1 < len(text)
            found, at = found + text[at], at + 1
    return found, at


def _substitute(text: str, at: int, scope: Any) -> tuple[str, int]:
    """The value of the substitution whose name begins at a position, and where the text goes on."""
    name = re.compile(r'[\w-]*').match(text, at)[0]
    if name not in SUBSTITUTIONS:
        raise ValueError(f'there is no $({name}) here; there is {", ".join(SUBSTITUTIONS)}')
    at += len(name)
    arguments = []
    while text.startswith(' ', at):
        quote = text[at + 1 : at + 2]
        if quote in ('"', "'"):
            argument, at = _expand(text, at + 2, quote, scope)
            at += 1
        else:
            argument, at = _expand(text, at + 1, ' ()"\'', scope)
        arguments.append(argument)
    if not text.startswith(')', at):
        raise ValueError(f'$({name} is not closed: quote an argument with spaces or brackets')
    try:
        return SUBSTITUTIONS[name](scope, *arguments), at + 1
    except TypeError:
        few_or_many = f'$({name}) does not take {len(arguments)} arguments'
        raise ValueError(f'{few_or_many}: quote one that has spaces') from None


def is_true(text: str) -> bool:
    """Whether a text is true. Raises ValueError if it is neither true nor false."""
    word = text.strip().lower()
    if word not in ('true', 'false', '1', '0'):
        raise ValueError(f"'{text}' is neither true nor false")
    return word in ('true', '1')


def share_of(package: str) -> Path:
    """The share folder of a package. Raises ValueError if it is not installed."""
    found = _index.packages()
    if package not in found:
        searched = [str(prefix) for prefix in _index.prefixes()]
        raise ValueError(f"package '{package}' not found, searching: {searched}")
    return found[package] / 'share' / package


def _look_up(kind: str, known: dict[str, str], name: str, *default: str) -> str:
    if name not in known and not default:
        raise ValueError(f"{kind} '{name}' does not exist")
    return known.get(name, *default)


# What an expression may be made of, so that a launch file runs no Python.
OPERATIONS = (
    *(ast.Expression, ast.Constant, ast.List, ast.Tuple, ast.Load, ast.Compare, ast.cmpop),
    *(ast.BoolOp, ast.boolop, ast.UnaryOp, ast.unaryop, ast.BinOp, ast.operator),
)


def evaluate(expression: str) -> str:
    """The value of an expression of constants, comparisons, logic and arithmetic, as a text.

    Raises ValueError for anything else.
    """
    try:
        tree = ast.parse(expression.strip(), mode='eval')
        for node in ast.walk(tree):
            if not isinstance(node, OPERATIONS):
                raise ValueError(
                    f"'{ast.unparse(node)}' in $(eval) is no comparison, logic or arithmetic of "
                    'values: a text needs quotes'
                )
        return str(eval(compile(tree, '$(eval)', 'eval'), {'__builtins__': {}}))
    except (SyntaxError, TypeError, ArithmeticError) as error:
        raise ValueError(f"$(eval '{expression}') has no value: {error}") from None


SUBSTITUTIONS: dict[str, Callable[..., str]] = {
    'var': lambda scope, *a: _look_up('launch configuration', scope.variables, *a),
    'env': lambda scope, *a: _look_up('environment variable', scope.environment, *a),
    'find-pkg-share': lambda scope, package: str(share_of(package)),
    'dirname': lambda scope: str(Path(scope.file).absolute().parent),
    'eval': lambda scope, expression: evaluate(expression),
}
