"""Messages as text and back: YAML and CSV as the real command prints and reads them."""

from __future__ import annotations

import array
import importlib
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import yaml

from helpers.ros2._errors import CommandError

PARTS = {'msg': ('SLOT_TYPES',), 'srv': ('Request', 'Response'), 'action': ('Goal', 'Result')}


def find_type(name: str, kind: str, error: str) -> type:
    """Return the class of an interface, for example of `std_msgs/msg/String` or `std_msgs/String`.

    Raises CommandError with `error` if there is none, or if it is of another kind.
    """
    *modules, last = name.split('/')
    if len(modules) == 1:
        modules.append(kind)
    try:
        found = getattr(importlib.import_module('.'.join(modules)), last)
    except (AttributeError, ImportError, ValueError, TypeError):
        raise CommandError(error) from None
    if not all(hasattr(found, part) for part in PARTS[kind]):
        raise CommandError(error)
    return found


# --- To text


def to_yaml(message: Any, flow_style: bool = False, **limits: Any) -> str:
    """Return a message as YAML. `limits`: truncate_length (int or None), no_arr and no_str."""
    settings = {'allow_unicode': True, 'width': sys.maxsize, 'default_flow_style': flow_style}
    return yaml.dump(_plain(message, None, **limits), Dumper=_Dumper, **settings)


class _Dumper(yaml.SafeDumper):
    """Keeps the order of fields, and puts each in a line of its own, also in the flow style."""


# PyYAML makes a space of these, as the real command does, unless they are in double quotes.
_Dumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar(
        'tag:yaml.org,2002:str', text, '"' if set(text) & set('\x85\u2028\u2029') else None
    ),
)
_Dumper.add_representer(
    dict,
    lambda dumper, fields: yaml.MappingNode(
        'tag:yaml.org,2002:map',
        [(dumper.represent_data(k), dumper.represent_data(v)) for k, v in fields.items()],
        flow_style=False,
    ),
)


def _plain(
    value: Any,
    slot: Any,
    truncate_length: int | None = None,
    no_arr: bool = False,
    no_str: bool = False,
) -> Any:
    limits = {'truncate_length': truncate_length, 'no_arr': no_arr, 'no_str': no_str}
    if hasattr(value, 'dtype') and not value.shape:  # a number of NumPy
        return value.item()
    if isinstance(value, bool | int | float):
        return value
    if isinstance(value, bytes | str):
        if no_str and isinstance(value, str):
            return f'<string length: <{len(value)}>>'
        text = value if isinstance(value, str) else value.decode('latin-1')
        cut = truncate_length is not None and len(text) > truncate_length
        return f'{text[:truncate_length]}...' if cut else text
    if hasattr(value, 'SLOT_TYPES'):
        return {name: _plain(getattr(value, name), slot, **limits) for name, slot in _slots(value)}
    if no_arr and slot is not None:
        return _shortened(value, slot)
    items = [_plain(item, None, **limits) for item in value[:truncate_length]]
    return [*items, '...'] if len(items) < len(value) else items


def to_csv(
    message: Any, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> str:
    """Return the values of a message with commas between them. The limits are those of YAML."""

    def text(value: Any, slot: Any = None) -> str:
        if hasattr(value, 'SLOT_TYPES'):
            return ','.join(text(getattr(value, name), slot) for name, slot in _slots(value))
        if isinstance(value, bytes | str):
            if no_str and isinstance(value, str):
                return f'<string length: <{len(value)}>>'
            if truncate_length is not None and len(value) > truncate_length:
                dots = '...' if isinstance(value, str) else b'...'
                value = value[:truncate_length] + dots
            return str(value)
        if not hasattr(value, '__len__'):
            return str(value)
        if no_arr and slot is not None:
            return _shortened(value, slot)
        items = ','.join(text(item) for item in value[:truncate_length])
        return f'{items},...' if len(value) > len(value[:truncate_length]) else items

    return text(message)


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
    """Read what a user has typed, or a file of it. Raises CommandError where it is not YAML."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        where = getattr(error, 'problem_mark', None)
        column = f' in column {where.column + 1}' if where else ''
        problem = getattr(error, 'problem', None) or 'a character that it cannot have'
        raise CommandError(f'The passed value is not YAML: {problem}{column}') from None


def filled(message: Any, text: Any, error: str, stamps: bool = False) -> tuple[Any, list]:
    """Set fields of a message from YAML, text or a file, and return the message.

    With `stamps`, `auto` for a header and `now` for a time are allowed: the functions that are
    returned as well set these to the time they get.

    Raises CommandError with `error`, which has a place for the reason.
    """
    setters: list[Callable[[Any], None]] = []
    values = read_yaml(text)
    if stamps and not isinstance(values, dict):
        raise CommandError('The passed value needs to be a dictionary in YAML format')
    try:
        _fill(message, values, setters if stamps else None)
    except Exception as reason:  # as many as setters of messages have
        raise CommandError(error.format(reason)) from None
    return message, setters


def _fill(message: Any, values: Any, setters: list | None) -> None:
    if not isinstance(values, dict):
        kind = type(values).__name__
        raise TypeError(f"Value '{values}' is expected to be a dictionary but is a {kind}")
    slots = dict(_slots(message))
    for name, value in values.items():
        old = getattr(message, name)
        kind = f'{type(old).__module__}.{type(old).__name__}'
        if setters is not None and (value, kind) == ('auto', 'std_msgs.msg._header.Header'):
            setters.append(partial(setattr, old, 'stamp'))
        elif setters is not None and (value, kind) == ('now', 'builtin_interfaces.msg._time.Time'):
            setters.append(partial(setattr, message, name))
        elif hasattr(old, 'SLOT_TYPES'):
            new = type(old)()
            _fill(new, value, setters)
            setattr(message, name, new)
        else:
            setattr(message, name, _converted(old, value, slots.get(name), setters))


def _converted(old: Any, value: Any, slot: Any, setters: list | None) -> Any:
    """Return a value as the type of the field's old value, as far as Python converts it."""
    if isinstance(old, bytes):
        return value.encode('latin-1') if isinstance(value, str) else bytes(value)
    if isinstance(old, array.array):
        return array.array(old.typecode, value)
    if hasattr(old, 'dtype'):
        import numpy

        return numpy.array(value, dtype=old.dtype)
    if not isinstance(old, list):
        return value if type(value) is type(old) else type(old)(value)
    item, items = slot.value_type, list(value)
    if hasattr(item, 'namespaced_name'):
        *modules, last = item.namespaced_name()
        messages = [getattr(importlib.import_module('.'.join(modules)), last)() for _ in items]
        for message, values in zip(messages, items, strict=True):
            _fill(message, values, setters)
        return messages
    if getattr(item, 'typename', '') == 'octet':
        return [_converted(b'', one, None, None) for one in items]
    return items
