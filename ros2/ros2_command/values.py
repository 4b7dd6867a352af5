"""Messages as text and back: YAML and CSV as the real command prints and reads them."""

from __future__ import annotations

import array
import importlib
import sys
from typing import Any

import yaml

from ros2_command.commands import CommandError

PARTS = {'msg': ('SLOT_TYPES',), 'srv': ('Request', 'Response'), 'action': ('Goal', 'Result')}


def find_type(name: str, kind: str, error: str) -> type:
    """Return the class of an interface, for example of `std_msgs/msg/String` or `std_msgs/String`.

    Raises CommandError with `error` if there is none, or if it is of another kind.
    """
    *modules, last = name.split('/')
    if len(modules) == 1:
        modules.append(kind)
    try:
        class_ = getattr(importlib.import_module('.'.join(modules)), last)
    except (AttributeError, ImportError, ValueError, TypeError):
        raise CommandError(error) from None
    if not all(hasattr(class_, part) for part in PARTS[kind]):
        raise CommandError(error)
    return class_


# --- To text


def to_yaml(message: Any, flow_style: bool = False, **limits: Any) -> str:
    """Return a message as YAML. `limits`: truncate_length (int or None) and no_arr."""
    settings = {'allow_unicode': True, 'width': sys.maxsize, 'default_flow_style': flow_style}
    return yaml.dump(_plain(message, **limits), Dumper=_Dumper, **settings)


def to_csv(message: Any, **limits: Any) -> str:
    """Return the values of a message with commas between them. The limits are those of YAML."""

    def text(value: Any) -> str:
        items = value.values() if isinstance(value, dict) else value
        return ','.join(map(text, items)) if isinstance(value, dict | list) else str(value)

    return text(_plain(message, **limits))


class _Dumper(yaml.SafeDumper):
    """Keeps the order of fields, and puts each in a line of its own, also in the flow style."""

    def text(self, text: str) -> yaml.Node:
        # PyYAML makes a space of these, as the real command does, unless they are in quotes.
        quotes = '"' if set(text) & set('\x85\u2028\u2029') else None
        return self.represent_scalar('tag:yaml.org,2002:str', text, quotes)

    def fields(self, fields: dict[str, Any]) -> yaml.Node:
        pairs = [
            (self.represent_data(name), self.represent_data(value))
            for name, value in fields.items()
        ]
        return yaml.MappingNode('tag:yaml.org,2002:map', pairs, flow_style=False)


_Dumper.add_representer(str, _Dumper.text)
_Dumper.add_representer(bytes, lambda dumper, value: dumper.text(value.decode('latin-1')))
_Dumper.add_representer(dict, _Dumper.fields)
# What is left is a number of NumPy.
_Dumper.add_representer(None, lambda dumper, number: dumper.represent_data(number.item()))


def _plain(
    value: Any, slot: Any = None, truncate_length: int | None = None, no_arr: bool = False
) -> Any:
    """Return a message as a dict, an array as a list, both cut to the limits."""
    if hasattr(value, 'SLOT_TYPES'):
        return {
            name: _plain(getattr(value, name), slot, truncate_length, no_arr)
            for name, slot in _slots(value)
        }
    if not hasattr(value, '__len__'):
        return value
    cut = value[:truncate_length]
    if isinstance(value, bytes | str):
        dots = '...' if isinstance(value, str) else b'...'
        return cut + dots if len(cut) < len(value) else value
    if no_arr and slot is not None:
        return _shortened(value, slot)
    items = [_plain(item, None, truncate_length, no_arr) for item in cut]
    return [*items, '...'] if len(cut) < len(value) else items


def _slots(message: Any) -> zip:
    return zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True)


def _shortened(value: Any, slot: Any) -> str:
    """Return what stands for an array, such as `<sequence type: float, length: 3>`."""
    item = slot.value_type
    if hasattr(item, 'typename'):
        name = item.typename
    elif hasattr(item, 'namespaced_name'):
        name = '/'.join(item.namespaced_name())
    else:
        name = 'wstring' if 'WString' in type(item).__name__ else 'string'
    if hasattr(slot, 'size'):
        return f'<array type: {name}[{slot.size}]>'
    bound = f'[{slot.maximum_size}]' if slot.has_maximum_size() else ''
    return f'<sequence type: {name}{bound}, length: {len(value)}>'


# --- From text


def read_yaml(text: Any) -> Any:
    """Read what a user has typed. Raises CommandError if it is not YAML."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        column = f' in column {mark.column + 1}' if mark else ''
        problem = getattr(error, 'problem', None) or 'a character that it cannot have'
        raise CommandError(f'The passed value is not YAML: {problem}{column}') from None


def filled(message: Any, text: str, error: str) -> Any:
    """Set fields of a message from YAML, and return the message.

    Raises CommandError with `error`, which has a place for the reason.
    """
    values = read_yaml(text)
    if not isinstance(values, dict):
        raise CommandError('The passed value needs to be a dictionary in YAML format')
    try:
        _fill(message, values)
    except Exception as reason:  # as many as setters of messages have
        raise CommandError(error.format(reason)) from None
    return message


def _fill(message: Any, values: Any) -> Any:
    if not isinstance(values, dict):
        kind = type(values).__name__
        raise TypeError(f"Value '{values}' is expected to be a dictionary but is a {kind}")
    slots = dict(_slots(message))
    for name, value in values.items():
        setattr(message, name, _converted(getattr(message, name), value, slots.get(name)))
    return message


def _converted(old: Any, value: Any, slot: Any) -> Any:
    """Return a value as the type of the field's old value, as far as Python converts it."""
    if hasattr(old, 'SLOT_TYPES'):
        return _fill(type(old)(), value)
    if isinstance(old, bytes):
        return value.encode('latin-1') if isinstance(value, str) else bytes(value)
    if isinstance(old, array.array):
        return array.array(old.typecode, value)
    if hasattr(old, 'dtype'):
        import numpy

        return numpy.array(value, dtype=old.dtype)
    if not isinstance(old, list):
        return value if type(value) is type(old) else type(old)(value)
    item = slot.value_type
    if hasattr(item, 'namespaced_name'):
        *modules, last = item.namespaced_name()
        class_ = getattr(importlib.import_module('.'.join(modules)), last)
        return [_fill(class_(), element) for element in value]
    if getattr(item, 'typename', '') == 'octet':
        return [_converted(b'', element, None) for element in value]
    return list(value)
