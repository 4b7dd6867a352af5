"""A launch file as elements, the same for XML and YAML, whose tags and attributes are checked."""

from __future__ import annotations

import xml.parsers.expat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import yaml

from ros2_command.commands import CommandError


@dataclass(frozen=True)
class Rule:
    """What an element may have, by its tag."""

    required: tuple[str, ...] = ()  # attributes
    optional: tuple[str, ...] = ()  # attributes
    parts: tuple[str, ...] = ()  # children that describe it, such as a `param` of a node
    has_actions: bool = False  # its children are actions


CONDITIONS = ('if', 'unless')  # of each action
PROCESS = ('output', 'respawn', 'respawn_delay', 'respawn_max_retries', 'on_exit')
PAIR = Rule(required=('name', 'value'))
ROOT = Rule(optional=('version',), has_actions=True)
ACTIONS = {
    'arg': Rule(required=('name',), optional=('default', 'description')),
    'let': PAIR,
    'node': Rule(
        required=('exec',),
        optional=('pkg', 'name', 'namespace', 'args', *PROCESS),
        parts=('param', 'remap', 'env'),
    ),
    'executable': Rule(required=('cmd',), optional=('name', *PROCESS), parts=('env',)),
    'group': Rule(has_actions=True),
    'include': Rule(required=('file',), parts=('arg', 'let')),
    'push_ros_namespace': Rule(required=('namespace',)),
    'push-ros-namespace': Rule(required=('namespace',)),
    'set_env': PAIR,
}
PARTS = {
    'param': Rule(optional=('name', 'value', 'type', 'from')),
    'remap': Rule(required=('from', 'to')),
    'env': PAIR,
    'arg': PAIR,
    'let': PAIR,
}
# What need not be a text in YAML. The value of a `param` may be of any type, too.
NUMBERS = 'respawn_delay', 'respawn_max_retries', 'version'
# The same actions in a launch file in Python.
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

    def parts(self, tag: str) -> list[Element]:
        """Return the children of a tag."""
        return [child for child in self.children if child.tag == tag]


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
    root = _read_xml(text, str(path)) if is_xml else _read_yaml(text, str(path))
    if root.tag != 'launch':
        root.fail(f"a launch file begins with 'launch', not with '{root.tag}'.")
    _check(root, ROOT, is_xml)
    return root


def _read_xml(text: str, file: str) -> Element:
    parser = xml.parsers.expat.ParserCreate()
    document = Element('', file, 1)
    opened = [document]

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, file, parser.CurrentLineNumber, attributes)
        opened[-1].children.append(element)
        opened.append(element)

    def end(tag: str) -> None:
        opened.pop()

    def characters(data: str) -> None:
        if data.strip():
            opened[-1].line = parser.CurrentLineNumber
            opened[-1].fail(f"the text '{data.strip()}' is in no attribute.")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    try:
        parser.Parse(text, True)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        Element('', file, error.lineno).fail(f'this is no valid XML: {reason}.')
    [root] = document.children
    return root


def _read_yaml(text: str, file: str) -> Element:
    try:
        loader = yaml.SafeLoader(text)
        return _YamlReader(file, loader).action(loader.get_single_node())
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        reason = getattr(error, 'problem', None) or 'it has a character that is not allowed'
        Element('', file, mark.line + 1 if mark else 1).fail(f'no valid YAML: {reason}.')


class _YamlReader:
    """Makes elements of PyYAML's nodes, which know their lines."""

    def __init__(self, file: str, loader: yaml.SafeLoader) -> None:
        self._file, self._loader = file, loader

    def action(self, node: yaml.Node | None) -> Element:
        """Return an action: one key, its tag, and what is below it."""
        if not isinstance(node, yaml.MappingNode) or len(node.value) != 1:
            line = node.start_mark.line + 1 if node else 1
            sentence = 'an action is one key, such as `node:`, and its value.'
            Element('', self._file, line).fail(sentence)
        [(key, value)] = node.value
        return self._element(str(key.value), value, key.start_mark.line + 1)

    def _element(self, tag: str, node: yaml.Node, line: int) -> Element:
        element = Element(tag, self._file, line)
        if isinstance(node, yaml.SequenceNode):
            element.children = [self.action(item) for item in node.value]
        elif isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                self._add(element, str(key.value), value)
        else:
            element.fail(f"'{tag}' needs its attributes below it.")
        return element

    def _add(self, element: Element, name: str, node: yaml.Node) -> None:
        """Add an attribute to an element, or the parts that have this name."""
        if name in PARTS and isinstance(node, yaml.SequenceNode):
            for item in node.value:
                part = self._element(name, item, item.start_mark.line + 1)
                element.children.append(part)
        elif name in PARTS and isinstance(node, yaml.MappingNode):
            element.fail(f"'{name}' must be a list: write `- ` before it, below '{name}:'.")
        else:
            element.attributes[name] = self._loader.construct_object(node, deep=True)


def _check(element: Element, rule: Rule, is_xml: bool, is_action: bool = False) -> None:
    """Check the attributes of an element, and all that is below it."""
    tag = f'<{element.tag}>' if is_xml else f"'{element.tag}'"
    names = (*rule.required, *rule.optional)
    if is_action:
        names = (*CONDITIONS, *names)
    for name, value in element.attributes.items():
        if name not in names:
            element.fail(f"{tag} has no attribute '{name}' here; it has {', '.join(names)}.")
        if not isinstance(value, str) and name not in NUMBERS and element.tag != 'param':
            wanted = f'"{value}", a text in quotes'
            element.fail(f"'{name}' of {tag} must be {wanted}, also for the real command.")
    for name in rule.required:
        if name not in element.attributes:
            element.fail(f"{tag} needs the attribute '{name}'.")
    rules = {name: PARTS[name] for name in rule.parts}
    if rule.has_actions:
        rules = ACTIONS
    for child in element.children:
        if child.tag not in rules:
            known = ', '.join(rules) or 'only attributes'
            child.fail(f"{tag} has no '{child.tag}' here; it has {known}.")
        _check(child, rules[child.tag], is_xml, is_action=rule.has_actions)
