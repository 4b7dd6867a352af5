"""What a class may be told. Everything else is refused with one sentence."""

import json
import unicodedata

from jsonschema import Draft202012Validator

from helpers.checks.classroom import BATCH, ITEMS, LARGEST
from helpers.checks.classroom import TEXT as LONGEST

LARGEST_BODY = 256 * 1024  # bytes
NUMBER = {'type': 'number', 'minimum': -LARGEST, 'maximum': LARGEST}
# No letter may end a line, be unseen, or turn the direction of reading.
PRINTABLE = r'^[^\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]*\Z'
TEXT = {'type': 'string', 'maxLength': LONGEST, 'pattern': PRINTABLE}
PLAIN = {'anyOf': [{'type': 'boolean'}, NUMBER, TEXT]}
VALUE = {'anyOf': [PLAIN, {'type': 'array', 'maxItems': ITEMS, 'items': PLAIN}]}


def _form(**fields: dict) -> Draft202012Validator:
    """Return the form of an object that has these fields and no others."""
    form = {'type': 'object', 'properties': fields, 'required': [*fields]}
    return Draft202012Validator(form | {'additionalProperties': False})


EVENT = {
    'id': {'type': 'string', 'pattern': r'^[0-9a-f]{16}\Z'},
    'kind': TEXT,
    'lesson': TEXT,
}
KINDS = {
    'guess': _form(**EVENT, question=TEXT, value=VALUE),
    'outcome': _form(**EVENT, question=TEXT, value=VALUE),
    'task': _form(**EVENT, task=TEXT, solved={'type': 'boolean'}),
    'about': _form(**EVENT, about=TEXT, task=TEXT),
    'cell': _form(**EVENT, cell=TEXT),
    'hand': _form(**EVENT, up={'type': 'boolean'}),
}
MINUTES = {'type': 'integer', 'minimum': 0}
# What the deck of `make present` tells: the id of a cell, since when the minutes run, and those
# that are planned for this step, to its end, and in all.
SLIDE = _form(
    lesson=TEXT,
    cell=TEXT,
    began_s={'type': ['number', 'null']},
    own=MINUTES,
    planned=MINUTES,
    all=MINUTES,
)
EVENTS = _form(events={'type': 'array', 'maxItems': BATCH})
JOIN = _form(code=TEXT, name={'type': 'string', 'maxLength': 1000})
LONGEST_NAME = 40  # letters, without what stands above and below them
JOINERS = '\u200c\u200d'  # letters of Persian, Hindi and others hang together, or do not, by these


def plain_name(name: str) -> str:
    """Return a name as the page shows it: in any letters, without signs that nobody sees.

    Raises ValueError with one sentence if it is too long.
    """
    unseen = ('Cc', 'Cf', 'Cs', 'Co', 'Cn', 'Zl', 'Zp')
    seen = [
        one if one in JOINERS or unicodedata.category(one) not in unseen else ' ' * one.isspace()
        for one in unicodedata.normalize('NFC', name)
    ]
    name = ' '.join(''.join(seen).split()).strip(JOINERS)
    letters = sum(unicodedata.category(one)[0] != 'M' for one in name if one not in JOINERS)
    if letters > LONGEST_NAME or len(name) > 4 * LONGEST_NAME:
        count = max(letters, len(name) // 4)
        raise ValueError(
            f'A name has {LONGEST_NAME} letters at most, and this one has {count}: take a shorter '
            'one.'
        )
    return name


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
    return isinstance(kind, str) and kind in KINDS and KINDS[kind].is_valid(event)
