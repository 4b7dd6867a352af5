"""What a student's computer may send. Everything else is refused with one sentence."""

import json
import time

from jsonschema import Draft202012Validator

LARGEST_BODY = 256 * 1024  # bytes
NUMBER = {'type': 'number', 'minimum': -(2**53), 'maximum': 2**53}
# No letter may end a line, be unseen, or turn the direction of reading.
PRINTABLE = r'^[^\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]*\Z'
TEXT = {'type': 'string', 'maxLength': 200, 'pattern': PRINTABLE}
PLAIN = {'anyOf': [{'type': 'boolean'}, NUMBER, TEXT]}


def _nested(inner: dict) -> dict:
    items = {'type': 'array', 'maxItems': 20, 'items': inner}
    named = {'type': 'object', 'maxProperties': 20, 'additionalProperties': inner}
    return {'anyOf': [PLAIN, items, named | {'propertyNames': TEXT}]}


def _kind(kind: str, **what: dict) -> dict:
    properties = {
        'id': {'type': 'string', 'pattern': r'^[0-9a-f]{16}\Z'},
        'kind': {'const': kind},
        'lesson': {'type': 'string', 'maxLength': 80},
        **what,
    }
    return {
        'type': 'object',
        'properties': properties,
        'required': list(properties),
        'additionalProperties': False,
    }


VALUE = _nested(_nested(PLAIN))
KINDS = {
    'guess': _kind('guess', question=TEXT, value=VALUE),
    'outcome': _kind('outcome', question=TEXT, value=VALUE),
    'exercise': _kind('exercise', exercise={'type': 'integer'}, solved={'type': 'boolean'}),
    'cell': _kind('cell', cell=TEXT),
    'hand': _kind('hand', up={'type': 'boolean'}),
}
FORMS = {kind: Draft202012Validator(schema) for kind, schema in KINDS.items()}
ENVELOPE = Draft202012Validator(
    {
        'type': 'object',
        'properties': {'events': {'type': 'array', 'maxItems': 50}},
        'required': ['events'],
        'additionalProperties': False,
    }
)
NAME = Draft202012Validator(
    {
        'type': 'object',
        'properties': {
            'code': {'type': 'string', 'maxLength': 60},
            'name': TEXT | {'maxLength': 40},
        },
        'required': ['code'],
        'additionalProperties': False,
    }
)


def parse(body: bytes, form: Draft202012Validator) -> dict:
    """Return what a message holds. Raises ValueError with one sentence for any other form."""
    try:
        found = json.loads(body, parse_constant=_refuse)
        json.dumps(found, ensure_ascii=False).encode()
    except (ValueError, RecursionError):  # among them what is no UTF-8
        raise ValueError('This is no message to a class: it is not JSON.') from None
    if not form.is_valid(found):
        raise ValueError('This is no message to a class: it has another form.')
    return found


def _refuse(constant: str) -> None:
    raise ValueError(constant)  # NaN and Infinity are no JSON


def is_event(event: object) -> bool:
    """Return whether an event has the form of its kind."""
    kind = event.get('kind') if isinstance(event, dict) else None
    return isinstance(kind, str) and kind in FORMS and FORMS[kind].is_valid(event)


class Limit:
    """Allows `rate` things a second for long, and `burst` at once."""

    def __init__(self, rate: float, burst: int) -> None:
        self.rate, self.burst = rate, burst
        self._left, self._at = float(burst), time.monotonic()

    def left(self) -> float:
        """Return how many things are allowed now."""
        now = time.monotonic()
        self._left = min(self.burst, self._left + (now - self._at) * self.rate)
        self._at = now
        return self._left

    def take(self, count: int = 1) -> bool:
        """Return whether `count` things are allowed now, and count them if they are."""
        if self.left() < count:
            return False
        self._left -= count
        return True
