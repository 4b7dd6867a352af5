"""Each rule complains about a notebook broken on purpose, and about nothing in a correct one."""

import os
import re
import subprocess
import sys
from html import unescape
from pathlib import Path

import nbformat
import notebook_rules as rules
import pytest
from nbformat.v4 import (
    new_code_cell,
    new_markdown_cell,
    new_notebook,
    new_output,
    new_raw_cell,
)
from nbval.plugin import get_sanitize_patterns

from tools import notebooks as tool
from tools import slides

SANITIZE = Path(__file__).parent / 'nbval_sanitize.cfg'
OPENING = """\
# 02 Lose messages

**You will do**: make a subscriber lose messages.

**You will learn**
- **what a queue keeps**: the newest messages.
- **what it loses**: the oldest.

**You need** lesson 01.

**Time**: 20 minutes."""
RECAP = """\
## Recap

- **what a queue keeps**: as many as its depth.
- **what it loses**: those that newer ones pushed out."""
FOLDED = '\n\n'.join(
    f'<details lang="{lang}">\n<summary>{lang}</summary>\n{"word " * 100}\n</details>'
    for lang in ('fr', 'ur', 'vi')
)
RANDOM_LOG = """\
import random
for number in random.sample(range(1000), k=random.randint(5, 15)):
    print(f'[INFO] [slow_subscriber]: I heard: "Hello World: {number}"')"""
RANDOM_FIGURE = """\
import random
import matplotlib.pyplot as plt
from helpers.alt_text import describe
_, axes = plt.subplots()
line = axes.plot([random.random() for _ in range(9)])
describe(axes, 'A line through <nine> "points".')"""
ANSWERS = ['It keeps the newest.', 'It keeps the oldest.', 'It keeps none.']
SOLUTION = '# Solution of exercise 1\ndepth = 20\ncheck_depth(depth)'
PASSED = '[ok] depth is 20\n[ok] none is lost\nSolution: 2 of 2.\n'
FAILED = '[not yet] depth is 20\n[ok] none is lost\nExercise {} of lesson 02: 1 of 2.\n'
ALT = 'One dot for each of 41 messages. Some were lost.'


def printed(text, name='stdout'):
    return [new_output('stream', name=name, text=text)]


def shown(kind='execute_result', **data):
    return [new_output(kind, data={name.replace('_', '/'): text for name, text in data.items()})]


def code(source, *tags, outputs=()):
    cell = new_code_cell(source, outputs=list(outputs))
    if tags:
        cell.metadata.tags = list(tags)
    if 'solution' in tags:
        cell.metadata.jupyter = {'source_hidden': True}
    return cell


def figure(alt):
    html = f'<img alt="{alt}" src="data:image/png;base64,iVBO+0xabcdef/tmp/AA">'
    return shown('display_data', text_html=html, text_plain=alt)


def exercise(count):
    return [
        new_markdown_cell(f'### Exercise {count}: choose the depth\n\nChange the depth.'),
        code('depth = 10', 'exercise'),
        code('check_depth(depth)', 'check', outputs=printed(FAILED.format(count))),
        code(SOLUTION, 'solution', outputs=printed(PASSED)),
    ]


def question(count, right='ABC', answers=ANSWERS):
    """Return question `count`, whose right answer has the letter `right[count - 1]`."""
    text = f'### Question {count}: what stays\n\nWhat does a queue keep?\n\n'
    for letter, answer in zip('ABCDE', answers, strict=False):
        verdict = 'Right' if letter == right[count - 1] else 'No'
        text += f'<details><summary>{letter}. {answer}</summary>\n\n**{verdict}.** See step 1.'
        text += '\n\n</details>\n'
    return new_markdown_cell(text.strip(), metadata={'editable': False})


def lesson(*cells, before=()):
    """Return a correct lesson 02. `cells` come at the end of its step, `before` at the start."""
    notebook = new_notebook(
        cells=[
            new_markdown_cell(OPENING),
            code('from helpers import checks'),
            new_markdown_cell('## 1. Publish\n\n```python\n# a comment, no heading\n```'),
            *before,
            code('my_guess = 41', 'predict'),
            code('axes = draw(table)', outputs=figure(ALT)),
            code('checks.compare_prediction("How many?", my_guess, heard)'),
            *cells,
            *exercise(1),
            *exercise(2),
            new_markdown_cell(RECAP),
            new_markdown_cell('## Quiz\n\nThree questions.'),
            *map(question, (1, 2, 3)),
            new_markdown_cell('## In practice\n\nA real robot has [more](02_lose_messages.ipynb).'),
        ]
    )
    for count, (_, cell) in enumerate(rules.code_cells(notebook), 1):
        cell.execution_count = count
        for output in cell.outputs:
            if output.output_type == 'execute_result':
                output.execution_count = count
    return with_file_metadata(notebook)


def with_file_metadata(notebook):
    notebook.metadata = nbformat.from_dict(tool.NOTEBOOK_METADATA)
    for cell, slide_type in zip(notebook.cells, slides.slide_types(notebook), strict=True):
        cell.metadata.slideshow = nbformat.from_dict({'slide_type': slide_type})
    return notebook


def start():
    text = (
        '# 00 Start here\n\n**You will do**: look.\n\n**You need** Python.\n\n**Time**: 5 minutes.'
    )
    notebook = new_notebook(cells=[new_markdown_cell(text), code('1', outputs=[])])
    notebook.cells[1].execution_count = 1
    return with_file_metadata(notebook)


def glossary():
    notebook = start()
    notebook.cells[0].source = notebook.cells[0].source.replace('00 Start here', '99 Look up')
    return with_file_metadata(notebook)


@pytest.mark.parametrize('group', rules.GROUPS)
@pytest.mark.parametrize('correct', [lesson, start, glossary])
def test_a_correct_notebook_is_let_pass(correct, group):
    notebook = correct()
    nbformat.validate(notebook)
    assert rules.problems(notebook, group) == []


def note(text):
    metadata = {'tags': ['notes'], 'jupyter': {'source_hidden': True}}
    return new_raw_cell(text, metadata=nbformat.from_dict(metadata))


def with_source(index, old, new):
    """Return lesson 02 where one cell's source is changed."""
    notebook = lesson()
    assert old in notebook.cells[index].source
    notebook.cells[index].source = notebook.cells[index].source.replace(old, new)
    return notebook


def without(*indices):
    notebook = lesson()
    notebook.cells = [cell for at, cell in enumerate(notebook.cells) if at not in indices]
    return notebook


def with_cell(index, **changes):
    notebook = lesson()
    notebook.cells[index].update(nbformat.from_dict(changes))
    return notebook


def with_quiz(right, answers=ANSWERS):
    notebook = lesson()
    notebook.cells[-4:-1] = [question(count, right, answers) for count in (1, 2, 3)]
    return notebook


def with_metadata(index, **metadata):
    notebook = lesson()
    notebook.cells[index].metadata.update(nbformat.from_dict(metadata))
    return notebook


def with_notebook_metadata(**metadata):
    notebook = lesson()
    notebook.metadata.update(nbformat.from_dict(metadata))
    return notebook


def prints(text, name='stdout'):
    return lesson(code('run()', outputs=printed(text, name)))


def old_format():
    notebook = lesson()
    notebook.nbformat_minor = 4
    return notebook


ERROR = new_output('error', ename='ValueError', evalue='no', traceback=['in /home/ada/x.py'])
HTML = shown(text_html='<a href="/root/x">x</a>', text_plain='x')
TWO_PIECES = printed('1\n') + printed('2\n')
VIEW = shown('display_data', text_plain='Slider()') + [
    new_output('display_data', data={tool.WIDGET: {'model_id': '1'}})
]

RECAP_AT, QUIZ_AT = -6, -5

BROKEN = [
    (rules.executed_in_order, with_cell(1, execution_count=None)),
    (rules.executed_in_order, with_cell(3, execution_count=7)),
    (rules.executed_in_order, without(1)),
    (rules.no_errors, lesson(code('run()', outputs=[ERROR]))),
    (rules.no_stderr, prints('warning\n', 'stderr')),
    (rules.no_machine_paths, prints('saved in /home/ada/plot.csv\n')),
    (rules.no_machine_paths, prints('file:///tmp/x\n')),
    (rules.no_machine_paths, prints('lib/python3.11/site-packages/rclpy\n')),
    (rules.no_machine_paths, prints(r'C:\Users\ada' + '\n')),
    (rules.no_machine_paths, prints(f'in {Path(__file__).resolve().parent.parent}\n')),
    (rules.no_machine_paths, prints(f'in {sys.prefix}\n')),
    (rules.no_machine_paths, lesson(code('run()', outputs=HTML))),
    (rules.no_machine_paths, lesson(code('run()', outputs=[ERROR]))),
    (rules.nothing_moves, prints('<Node object at 0x7f12ab34cd56>\n')),
    (rules.nothing_moves, prints('heard by Thread-3 (spin)\n')),
    (rules.nothing_moves, prints('heard by ThreadPoolExecutor-0_1\n')),
    (rules.no_object_echo, lesson(code('a.plot(x)', outputs=shown(text_plain='<Axes: >')))),
    (rules.no_object_echo, lesson(code('a.plot(x)', outputs=shown(text_plain='[<Line2D>]')))),
    (rules.no_object_echo, lesson(code('a.text(x)', outputs=shown(text_plain="Text(0, 1, 'a')")))),
    (rules.no_last_semicolon, lesson(code('x = 1\na.plot(x);  # draws'))),
    (rules.no_last_semicolon, lesson(code('%matplotlib inline\na.plot(x);'))),
    (rules.no_changed_outputs, lesson(code('clear_output(wait=True)'))),
    (rules.no_changed_outputs, lesson(code('bar = display(0, display_id=True)'))),
    (rules.pictures_described, lesson(code('draw(b)', outputs=figure(ALT)))),
    (rules.pictures_described, lesson(code('draw(b)', outputs=figure('A figure.')))),
    (rules.pictures_described, lesson(code('draw(b)', outputs=shown(text_html='<img src="b">')))),
    (rules.pictures_described, lesson(code('draw(b)', outputs=shown(image_png='iVBO')))),
    (rules.pictures_described, lesson(new_markdown_cell('![](images/b.png)'))),
    (rules.pictures_described, lesson(new_markdown_cell('<img src="images/b.png">'))),
    (rules.nothing_ignored, lesson(code('# NBVAL_IGNORE_OUTPUT\nrun()'))),
    (rules.nothing_ignored, lesson(code('# NBVAL_IGNORE_OUTPUT\n# Not compared:\nrun()'))),
    (rules.nothing_ignored, lesson(code('run()', 'nbval-ignore-output'))),
    (rules.nothing_ignored, lesson(code('# Not compared: slow.\n# NBVAL_SKIP\nrun()'))),
    (rules.nothing_ignored, lesson(code('# Not compared: no.\nrun()', 'nbval-skip'))),
    (rules.nothing_ignored, lesson(code('run()  \n  # NBVAL_RAISES_EXCEPTION'))),
    (rules.nothing_ignored, lesson(code('run()', 'raises-exception'))),
    (rules.nothing_ignored, lesson(code('# NBVAL_CHECK_OUTPUT\nrun()'))),
    (rules.nothing_ignored, lesson(code('# PYTEST_VALIDATE_IGNORE_OUTPUT\nrun()'))),
    (rules.nothing_ignored, lesson(code('%%capture\nrun()'))),
    (rules.known_tags, lesson(code('run()', 'skip-execution'))),
    (rules.known_tags, lesson(code('run()', 'solutoin'))),
    (rules.saved_clean, with_metadata(1, collapsed=True)),
    (rules.saved_clean, with_metadata(1, tags=[])),
    (rules.saved_clean, with_metadata(1, execution={'iopub.status.idle': '2025-01-01'})),
    (rules.saved_clean, with_metadata(1, jupyter={'outputs_hidden': True})),
    (rules.saved_clean, with_metadata(0, editable=False)),
    (rules.saved_clean, with_metadata(-2, editable=True)),
    (rules.saved_clean, with_notebook_metadata(widgets={})),
    (
        rules.saved_clean,
        with_notebook_metadata(language_info={'name': 'python', 'version': '3.11'}),
    ),
    (rules.saved_clean, with_cell(1, id=lesson().cells[0].id, outputs=TWO_PIECES)),
    (rules.saved_clean, lesson(code('run()', outputs=VIEW))),
    (rules.saved_clean, prints('1 of 2\r2 of 2\n')),
    (rules.saved_clean, old_format()),
    (rules.hides_solutions_and_notes_only, with_metadata(1, jupyter={'source_hidden': True})),
    (
        rules.hides_solutions_and_notes_only,
        lesson(new_code_cell('x', metadata={'tags': ['solution']})),
    ),
    (rules.folded_solutions_keep_their_secret, lesson(code('depth = 20', 'solution'))),
    (rules.has_title, with_source(0, '# 02 Lose', '# Lose')),
    (rules.has_title, without(0)),
    (rules.has_title, new_notebook()),
    (rules.has_labels, with_source(0, '**You need**', 'You need')),
    (rules.has_labels, with_source(0, '**You will learn**', '**You could learn**')),
    (rules.has_labels, with_source(0, '**Time**', '## Time')),
    (rules.has_steps, with_source(2, '## 1. Publish', '## Publish')),
    (rules.has_steps, with_source(2, '## 1. Publish', '## 2. Publish')),
    (rules.has_steps, with_source(RECAP_AT, '## Recap', '## Summary')),
    (rules.has_steps, with_source(QUIZ_AT, '## Quiz', '## Questions')),
    (rules.has_steps, without(-1 + len(lesson().cells))),
    (rules.has_steps, with_source(-1, '## In practice', '## In practice\n\n## 2. Again')),
    (rules.headings_in_order, with_source(2, '## 1. Publish', '## 1. Publish\n\n#### Why')),
    (rules.headings_in_order, with_source(2, '## 1. Publish', '# 1. Publish')),
    (rules.recap_answers_opening, with_source(RECAP_AT, 'what it loses', 'what is lost')),
    (rules.recap_answers_opening, with_source(RECAP_AT, '- **what it loses**', '- what it loses')),
    (
        rules.recap_answers_opening,
        with_source(RECAP_AT, '\n- **what it loses**', '\n**what it loses**'),
    ),
    (rules.recap_answers_opening, without(len(lesson().cells) + RECAP_AT)),
    (rules.predicts, without(3)),
    (rules.predicts, with_source(3, 'my_guess = 41', 'print("guess")')),
    (rules.predicts, with_source(5, 'my_guess', 'your_guess')),
    (rules.predicts, with_source(5, 'compare_prediction', 'print')),
    (rules.enough_exercises, without(10, 11, 12, 13)),
    (rules.enough_exercises, with_source(10, 'Exercise 2', 'Exercise 3')),
    (rules.exercises_complete, without(7)),
    (rules.exercises_complete, without(8)),
    (rules.exercises_complete, without(9)),
    (rules.exercises_complete, lesson(code('check_depth(depth)', 'check'))),
    (rules.exercises_checked, with_cell(8, outputs=printed(PASSED))),
    (rules.exercises_checked, with_cell(9, outputs=printed(FAILED))),
    (rules.exercises_checked, with_cell(9, outputs=printed('[ok] depth is 20\n'))),
    (rules.exercises_checked, with_cell(9, outputs=[])),
    (rules.exercises_recorded, with_cell(8, outputs=printed(FAILED.format(2)))),
    (rules.exercises_recorded, with_cell(9, outputs=printed(FAILED.format(1)))),
    (rules.exercises_recorded, with_source(0, '# 02 Lose', '# 03 Lose')),
    (rules.enough_questions, without(len(lesson().cells) - 2)),
    (rules.enough_questions, with_source(-2, 'Question 3', 'Question 4')),
    (rules.enough_questions, with_source(-2, '### Question 3', 'Question 3')),
    (rules.answers_with_reasons, with_quiz('ABC', ANSWERS[:2])),
    (rules.answers_with_reasons, with_quiz('ABC', [*ANSWERS, 'All.', 'Some.'])),
    (rules.answers_with_reasons, with_source(-2, 'summary>B.', 'summary>C.')),
    (rules.answers_with_reasons, with_source(-2, '**No.** See step 1.', '**No.**')),
    (rules.answers_with_reasons, with_source(-2, '**No.**', 'No:')),
    (rules.answers_with_reasons, with_source(-2, '**No.**', '**Right.**')),
    (rules.answers_with_reasons, with_source(-2, '**Right.**', '**No.**')),
    (rules.answers_with_reasons, with_source(-2, '### Question 3', '<details>\n\n### Question 3')),
    (rules.answers_with_reasons, with_cell(-2, source=question(3).source + '\n\nB is near.')),
    (rules.right_answers_vary, with_quiz('BBB')),
    (rules.fits_a_slide, lesson(code('\n'.join(['run()'] * (rules.MAX_CODE_LINES + 1))))),
    (rules.fits_a_slide, lesson(code('%%write a\n' + 'run()\n' * rules.MAX_FILE_LINES))),
    (rules.fits_a_slide, lesson(new_markdown_cell('word ' * (rules.MAX_WORDS + 1)))),
    (rules.fits_a_slide, lesson(code('run()', outputs=printed('line\n' * 40)))),
    (rules.on_its_slide, with_cell(2, metadata={})),
    (rules.on_its_slide, with_metadata(2, slideshow={'slide_type': '-'})),
    (rules.notes_name_the_reader, lesson(note('Ask first.'))),
    (rules.notes_name_the_reader, lesson(code('For the instructor', 'notes'))),
]


@pytest.mark.parametrize(('rule', 'notebook'), BROKEN, ids=[rule.__name__ for rule, _ in BROKEN])
def test_a_broken_notebook_is_reported(rule, notebook):
    assert rule(notebook)
    assert all(sentence.endswith('.') for sentence in rule(notebook))


def test_every_rule_is_tried_on_a_broken_notebook():
    assert {rule for group in rules.GROUPS.values() for rule in group} == {r for r, _ in BROKEN}


@pytest.mark.parametrize(
    ('rule', 'notebook'),
    [
        (
            rules.nothing_ignored,
            lesson(code('# NBVAL_IGNORE_OUTPUT\n# Not compared: times.\nrun()')),
        ),
        (rules.no_machine_paths, prints('/dev/shm is empty; the topic /worker, 1/tmp, and/or\n')),
        (rules.no_machine_paths, prints('    python3/site-packages/my_pkg/\n')),
        (rules.nothing_moves, prints('worker 1 and 0x1F\n')),
        (rules.no_object_echo, lesson(code('t', outputs=shown(text_plain='<t>', text_html='t')))),
        (rules.no_last_semicolon, lesson(code('a = draw();'), code('f(";")'), code('%magic'))),
        (rules.has_steps, lesson(new_markdown_cell('## Exercises'))),
        (rules.answers_with_reasons, with_quiz('BDA', [*ANSWERS, 'All.'])),
        (rules.right_answers_vary, with_quiz('BBA')),
        (rules.fits_a_slide, lesson(new_markdown_cell('| word <b>|</b>' * (rules.MAX_WORDS)))),
        (rules.fits_a_slide, lesson(new_markdown_cell(FOLDED))),
        (rules.fits_a_slide, lesson(code('%%write a\n' + 'run()\n' * rules.MAX_CODE_LINES))),
        (rules.notes_name_the_reader, lesson(note('For the instructor: 5 minutes'))),
        (rules.hides_solutions_and_notes_only, lesson(note('For the instructor: 5 minutes'))),
    ],
)
def test_what_is_allowed_is_let_pass(rule, notebook):
    assert rule(notebook) == []


def test_rules_for_the_folder(tmp_path):
    names = ['01_publish.ipynb', '00_start_here.ipynb']
    assert rules.teaching_order(names) == []
    assert rules.teaching_order([])
    assert rules.teaching_order([*names, '03_run.ipynb']) == []  # 02 may still be unwritten
    assert rules.teaching_order(['01_publish.ipynb'])
    assert rules.teaching_order([*names, '01_again.ipynb'])
    assert rules.teaching_order([*names, '02-Lose.ipynb'])
    assert rules.title_matches('02_lose_messages.ipynb', lesson()) == []
    assert rules.title_matches('02_lose_everything.ipynb', lesson())
    in_cpp = new_notebook(cells=[new_markdown_cell('# 08 Share code in C++')])
    assert rules.title_matches('08_share_code_in_cpp.ipynb', in_cpp) == []
    assert rules.links_lead_somewhere(lesson(), tmp_path)
    (tmp_path / '02_lose_messages.ipynb').touch()
    assert rules.links_lead_somewhere(lesson(), tmp_path) == []
    assert rules.maps_every_lesson(start(), ['00_start_here.ipynb']) == []
    assert rules.maps_every_lesson(start(), names)
    text = tool.text_of(lesson())
    notebook = nbformat.reads(text, as_version=4)
    assert rules.saved_as_jupyter_does(text, notebook) == []
    assert rules.saved_as_jupyter_does(text.replace('\n ', '\n  '), notebook)


# The tool that executes and cleans


def saved(folder, *cells):
    path = folder / '00_try.ipynb'
    path.write_text(tool.text_of(new_notebook(cells=list(cells))), encoding='utf-8')
    return path


def test_cleaning_twice_changes_nothing_and_keeps_ids():
    notebook = lesson(code('run()', outputs=VIEW), code('run()', outputs=TWO_PIECES))
    notebook.cells[2].pop('id')
    notebook.cells[4].id = notebook.cells[3].id
    once = tool.clean(notebook)
    assert tool.clean(once) == once
    assert 'id' not in notebook.cells[2]  # the argument is left alone
    assert len({cell.id for cell in once.cells}) == len(once.cells)
    assert [cell.id for at, cell in enumerate(once.cells) if at not in (2, 4)] == [
        cell.id for at, cell in enumerate(notebook.cells) if at not in (2, 4)
    ]


def test_a_failing_cell_leaves_the_file_as_it_was(tmp_path, capsys):
    path = saved(tmp_path, code('print("new")'), new_markdown_cell('#'), code('1 / 0'), code('2'))
    before = path.read_bytes()
    assert tool.main([], tmp_path) == 1
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == [path.name]
    assert capsys.readouterr().err == (
        '00_try.ipynb: code cell 2 failed: ZeroDivisionError: division by zero '
        '(the file is as it was)\n'
    )


def test_a_cell_that_ends_its_kernel_or_takes_too_long_is_reported(tmp_path, monkeypatch, capsys):
    saved(tmp_path, code('import os'), code('os._exit(1)'))
    assert tool.main([], tmp_path) == 1
    monkeypatch.setattr(tool, 'CELL_TIMEOUT_S', 1)
    saved(tmp_path, code('import threading\nthreading.Event().wait(30)'))
    assert tool.main([], tmp_path) == 1
    assert capsys.readouterr().err == (
        '00_try.ipynb: code cell 2 failed: the kernel ended (the file is as it was)\n'
        '00_try.ipynb: code cell 1 failed: it took longer than 1 s (the file is as it was)\n'
    )


def test_an_unknown_lesson_is_reported(tmp_path, capsys):
    assert tool.main([], tmp_path) == 1
    saved(tmp_path, code('1'))
    assert tool.main(['--lesson', '07'], tmp_path) == 1
    assert capsys.readouterr().err.endswith("There is no single lesson '07'. Give one of 00.\n")


def test_nbval_agrees_with_what_the_tool_saves(tmp_path, monkeypatch):
    path = saved(
        tmp_path,
        code('import sys\nfrom pathlib import Path\nPath.cwd().name, sys.executable'),
        code('import os\nprint("seen")\n_ = os.write(1, b"at C level")'),
        code('import ipywidgets\nout = ipywidgets.Output()\nwith out:\n    print("in")\nout'),
        code(RANDOM_FIGURE),
        code('for i in range(3):\n    print(f"\\r{i} of 3", end="", flush=True)\nprint("\\rdone")'),
        code(RANDOM_LOG),
        code('print("first")'),
        code(f'%matplotlib inline\n{RANDOM_FIGURE}\nplt.show()'),
    )
    ids = [cell.id for cell in nbformat.read(path, as_version=4).cells]
    spec = tmp_path / 'jupyter' / 'kernels' / 'python3' / 'kernel.json'
    spec.parent.mkdir(parents=True)
    spec.write_text('{"argv": ["false"], "display_name": "another Python", "language": "python"}')
    with monkeypatch.context() as environment:  # as the tool may find it on a user's machine
        environment.setenv('JUPYTER_PATH', str(tmp_path / 'jupyter'))
        environment.delenv('PYTEST_CURRENT_TEST')
        assert tool.main(['--lesson', '00'], tmp_path) == 0
    notebook = nbformat.read(path, as_version=4)
    assert rules.saved_as_jupyter_does(path.read_text(encoding='utf-8'), notebook) == []
    assert rules.executed_in_order(notebook) == []
    assert [cell.id for cell in notebook.cells] == ids
    assert notebook.cells[0].outputs[0].data['text/plain'] == f'{(tmp_path.name, sys.executable)}'
    assert [output.text for output in notebook.cells[1].outputs] == ['seen\n']
    assert [output.text for output in notebook.cells[4].outputs] == ['done\n']
    for figure in (notebook.cells[3], notebook.cells[7]):
        [alt] = rules.alternative_texts(figure)
        assert unescape(alt) == 'A line through <nine> "points".'
    notebook.cells[6].outputs[0].text = 'second\n'
    data = notebook.cells[7].outputs[0].data
    data['text/html'] = data['text/html'].replace('A line', 'A curve')
    nbformat.write(notebook, path)
    report = nbval(path)
    assert '2 failed, 6 passed' in report
    assert 'Cell 6 - ' in report
    assert 'Cell 7 - ' in report


def nbval(path):
    """Run nbval as `make test` does; return what it printed."""
    options = ['--nbval', '--nbval-current-env', f'--nbval-sanitize-with={SANITIZE}']
    command = [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', *options, str(path)]
    return subprocess.run(command, cwd=path.parent, capture_output=True, text=True).stdout


def sanitized(text):
    for regex, replacement in get_sanitize_patterns(SANITIZE.read_text(encoding='utf-8')):
        text = re.sub(regex, replacement, text)
    return text


def test_the_sanitize_file_replaces_of_a_figure_only_the_pixels():
    html = '<img alt="One dot." src="data:image/png;base64,{}"> <a href="x">y</a>'
    assert sanitized(html.format('iVBO+/8=')) == sanitized(html.format('iVBOAAAA'))
    assert sanitized(html) != sanitized(html.replace('One', 'No'))
    assert sanitized(html).endswith('> <a href="x">y</a>')


def test_the_sanitize_file_replaces_of_the_logs_only_what_the_slow_subscriber_heard():
    line = '[INFO] [slow_subscriber]: I heard: "Hello World: {}"\n'
    log = ''.join(line.format(count) for count in range(5))
    assert sanitized(f'before\n{log}after\n') == 'before\n<what slow_subscriber heard>\nafter\n'
    assert sanitized(log + line.format(17)) == sanitized(log)
    for compared in (
        log.replace('slow_subscriber', 'minimal_subscriber'),
        log.replace('INFO', 'WARN'),
        log.replace('I heard', 'I lost'),
    ):
        assert sanitized(compared) == compared
