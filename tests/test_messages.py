"""The table of messages: what the lessons make and name, and what each of it means."""

import json
import re

from helpers.lesson import lessons, messages, read
from tools.site.messages import page


def lesson(*cells):
    """Return a lesson with texts, and with cells of code that have printed a list of lines."""
    notebook = []
    for number, cell in enumerate(cells):
        is_text = isinstance(cell, str)
        made = {'cell_type': 'markdown', 'source': cell} if is_text else {'cell_type': 'code'}
        if not is_text:
            text = ''.join(f'{line}\n' for line in cell)
            output = {'output_type': 'stream', 'name': 'stdout', 'text': text}
            made |= {'source': 'run()', 'outputs': [output], 'execution_count': 1}
        notebook.append({'id': f'cell-{number}', 'metadata': {}} | made)
    data = {'cells': notebook, 'metadata': {}, 'nbformat': 4, 'nbformat_minor': 5}
    return read(json.dumps(data), '03_break_it.ipynb')


def found(*cells):
    return [(one.text, one.meaning, one.cell) for one in messages(lesson(*cells))]


def test_a_line_of_an_error_means_what_the_next_text_says():
    assert found('## 1. Run', ['it runs', "KeyError: 'speed'"], 'Nobody declared it.\n\nMore.') == [
        ("KeyError: 'speed'", 'Nobody declared it.', 'cell-1')
    ]


def test_the_line_that_names_a_message_is_preferred():
    text = "First a word.\n- `KeyError: 'speed' is missing`: nobody declared it."
    (only,) = found('## 1. Run', ["KeyError: 'speed' is missing"], text)
    assert only[1:] == ("`KeyError: 'speed' is missing`: nobody declared it.", 'cell-1')


def test_before_a_heading_what_led_to_it_is_said():
    (only,) = found('## 1. Run\n\nTwo types.', ['RCLError: no'], '### ? Guess\n\nHow many?')
    assert only[1] == 'Two types.'


def test_a_table_of_messages():
    table = (
        '| message | cause |\n|---|---|\n'
        '| `no such file`, in C (`make`) | a header |\n| `export(X) fails`, `bad` | a name |'
    )
    assert [pair[:2] for pair in found('## 1. Read', table)] == [
        ('no such file', 'in C: a header'),
        ('export(X) fails', 'a name'),
        ('bad', 'a name'),
    ]


def test_another_table_has_no_messages():
    assert found('| message | holds |\n|---|---|\n| `sensor_msgs/Imu` | a rate |') == []


def test_a_message_in_a_sentence():
    text = 'It is built. It says `Could not find it anywhere`: the name is wrong. Use `error`.'
    (only,) = found(text)
    assert only[:2] == (
        'Could not find it anywhere',
        'It says `Could not find it anywhere`: the name is wrong.',
    )


def test_each_message_of_the_lessons_has_a_meaning_and_a_place():
    every = [message for one in lessons() for message in messages(one)]
    assert [message.text for message in every if not message.meaning or not message.step] == []
    assert {message.lesson.name for message in every} >= {
        *('set_parameters', 'make_a_package', 'bring_in_a_package'),
        *('use_a_message_in_your_own_interface', 'share_code_in_a_cpp_library'),
    }


def test_the_page_has_a_row_for_each_message():
    known = lessons()
    rows = re.findall(r'^\| `.*$', page(known), re.MULTILINE)
    assert len(rows) == sum(len(messages(one)) for one in known)
    assert all(len(re.findall(r'(?<!\\)\|', row)) == 4 for row in rows)
