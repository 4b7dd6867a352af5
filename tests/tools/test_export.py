"""What the exporter hands to nbconvert, and says without npm. tests/browser opens its decks."""

import re

import nbformat
import pytest
from nbformat.v4 import (
    new_code_cell,
    new_markdown_cell,
    new_notebook,
    new_output,
    new_raw_cell,
)

from tools.lessons import export

NOTE = 'For the instructor: 5 minutes\n\nAsk first.'


def shown(text):
    return new_output('execute_result', data={'text/plain': text})


@pytest.fixture
def lesson():
    return new_notebook(
        cells=[
            new_markdown_cell('# 02 Lose messages\n\nAfter [01](01_publish_and_subscribe.ipynb).'),
            new_raw_cell(NOTE, metadata={'tags': ['notes']}),
            new_code_cell('\n'.join(['run()'] * 20)),
            new_code_cell('run()', metadata={'tags': ['solution']}),
            new_code_cell('sliders', outputs=[shown('VBox(children=(IntSlider(value=1),))')]),
            new_code_cell('number', outputs=[shown('1')]),
        ]
    )


def test_notes_are_for_the_speaker_and_solutions_for_nobody(lesson):
    cells = export.for_reveal(lesson).cells
    types = [cell.metadata.slideshow['slide_type'] for cell in cells]
    assert types == ['slide', 'notes', 'fragment', 'skip', 'fragment', 'fragment']
    assert cells[1].cell_type == 'markdown'
    assert '(01_publish_and_subscribe.html)' in cells[0].source
    assert cells[2].metadata.tags == ['more-than-8-lines', 'more-than-18-lines']
    assert [len(cell.outputs) for cell in cells[4:]] == [0, 1]
    assert 'slideshow' not in lesson.cells[0].metadata  # the argument is left alone


def test_a_note_stays_as_long_as_its_step():
    code = '\n'.join(['run()'] * 20)
    cells = [
        new_markdown_cell('## 1. Run'),
        new_raw_cell(NOTE, metadata={'tags': ['notes']}),
        new_code_cell(code),
        new_markdown_cell('Again.'),
        new_code_cell(code),
        new_markdown_cell('## 2. Look'),
    ]
    cells = export.for_reveal(new_notebook(cells=cells)).cells
    steps = [cell.source for cell in cells if cell.metadata.slideshow['slide_type'] != 'fragment']
    assert steps == ['## 1. Run', NOTE, 'Again.', NOTE, '## 2. Look']
    assert len({cell.id for cell in cells}) == len(cells)


def test_the_reason_of_an_answer_is_folded_with_it(tmp_path):
    answer = '<details><summary>A. Yes.</summary>\n\nA reason.\n\n</details>'
    path = tmp_path / '02_lose_messages.ipynb'
    nbformat.write(new_notebook(cells=[new_markdown_cell(f'# 02 Lose messages\n\n{answer}')]), path)
    html = export.export(path, tmp_path).read_text(encoding='utf-8')
    folded = r'<details><summary>A\. Yes\.</summary>\s*<p>A reason\.</p>\s*</details>'
    assert re.search(folded, html)


def test_without_npm_one_sentence_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.setattr(export.fetch_packages, '__defaults__', (tmp_path / 'deck',))
    assert export.main([], output=tmp_path / 'slides') == 1
    assert capsys.readouterr().err == export.NEEDS_NPM + '\n'
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_lesson_is_reported(tmp_path, capsys):
    assert export.main(['77'], output=tmp_path) == 1
    assert capsys.readouterr().err.startswith("There is no single lesson '77'.")
