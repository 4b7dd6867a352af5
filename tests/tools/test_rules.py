"""The template keeps all rules; broken in one place, it breaks the one that it should."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_output, new_raw_cell

from tools.lessons import rules
from tools.lessons.clean import clean
from tools.lessons.lesson import FOLDER, Lesson, lessons
from tools.lessons.new import TEMPLATE

TEXT = TEMPLATE.read_text(encoding='utf-8')
FILE = '90_write_a_lesson.ipynb'
GLOSSARY = lessons()[-1]
FRENCH = '<details lang="fr">\n<summary>Français</summary>\nUn nœud (node) écoute.\n</details>'
URDU = (
    '<details lang="ur" dir="rtl">\n<summary>اردو</summary>\n'
    'قطار میں پیغام ہے <bdi dir="ltr">C++</bdi>۔\n</details>'
)
VIETNAMESE = '<details lang="vi">\n<summary>Tiếng Việt</summary>\nMột nút (node) ở đây.\n</details>'
LEAVE_OUT = 'When time runs out, leave out:'
ALT = 'alt="One dot for each of five messages."'


def lesson(text=TEXT, *cells, file=FILE):
    """Return the template, or what its text has become, with some cells before its exercises."""
    notebook = nbformat.reads(text, as_version=4)
    at = next(i for i, cell in enumerate(notebook.cells) if cell.source.startswith('## Exercises'))
    notebook.cells[at:at] = cells
    return Lesson(file, notebook)


def code(source='run()', *tags, outputs=()):
    cell = new_code_cell(source, metadata={'tags': list(tags)}, outputs=list(outputs))
    cell.execution_count = 9
    if 'solution' in tags:
        cell.metadata.jupyter = {'source_hidden': True}
    return cell


def printed(text, name='stdout'):
    return code(outputs=[new_output('stream', name=name, text=text)])


def shown(**data):
    bundle = {kind.replace('_', '/'): text for kind, text in data.items()}
    return code(outputs=[new_output('execute_result', data=bundle)])


def note(text):
    metadata = {'tags': ['notes'], 'jupyter': {'source_hidden': True}}
    return new_raw_cell(text, metadata=metadata)


def translated(text):
    """Return the template with its summary in all languages; `text` holds the other ones."""
    built = lesson()
    english, glossary = built.notebook.cells[1].source.split('\n\n')
    built.notebook.cells[1].source = '\n\n'.join([english, text, glossary])
    return built


def complaints(built):
    """Return the names of the rules that `built` breaks; each says what, in a sentence."""
    names = set()
    for rule in rules.EVERY + rules.LESSON:
        for sentence in rule(built):
            assert sentence.endswith('.')
            names.add(rule.__name__)
    return names


def test_the_template_keeps_all_rules():
    built = lesson()
    assert rules.problems(built) == []
    nbformat.validate(built.notebook)
    assert clean(built.notebook) == built.notebook
    assert rules.problems(translated('\n\n'.join([FRENCH, URDU, VIETNAMESE]))) == []


# A rule, a text in the file of the template, and what it becomes.
CHANGED = [
    ('opens', '# 90 Write a', '# 90 Read a'),
    ('opens', '# 90 Write a', '# 91 Write a'),
    ('opens', '# 90 Write a lesson', 'Write a lesson'),
    ('opens', '**You need**', 'You need'),
    ('steps', '## 1. Build', '## Build'),
    ('steps', '## 2. Predict', '## 3. Predict'),
    ('steps', '## Recap', '## Summary'),
    ('headings_in_order', '## 3. Run', '## 3. Run\\n\\n#### Why'),
    ('headings_in_order', '## 3. Run', '# 3. Run'),
    ('recap_answers_opening', '- **Count what arrives**: the same', '- **Count**: the same'),
    ('recap_answers_opening', '- **Count what arrives**: the same', '- Count: the same'),
    ('recap_answers_opening', '- **Count what arrives**: what', 'Count what arrives: what'),
    ('says_where_it_belongs', '**Time** 10 minutes', '**Time** 11 minutes'),
    ('says_where_it_belongs', '**Time** 10 minutes', '**Time** ten minutes'),
    ('says_where_it_belongs', 'For the instructor: 2 minutes', 'For the instructor: ask'),
    ('says_where_it_belongs', 'Part: nodes', 'Part: node'),
    ('says_where_it_belongs', 'Part: nodes', 'Timetables: half a day (step 9)\\nPart: nodes'),
    ('steps_have_minutes', 'For the instructor: 2 minutes', 'For the instructor: ask'),
    ('leaves_out_what_is_there', 'Part: nodes', f'Part: nodes\\n{LEAVE_OUT} step 9'),
    ('leaves_out_what_is_there', 'Part: nodes', f'Part: nodes\\n{LEAVE_OUT} steps 1 and 9'),
    ('leaves_out_what_is_there', 'Part: nodes', f'Part: nodes\\n{LEAVE_OUT} exercise 2'),
    ('needs_what_came_before', '**You need**', '**You need** lesson 01 and 90,'),
    ('has_what_a_lesson_has', '"predict"', '"deck-break"'),
    ('has_what_a_lesson_has', '### Exercise 1', '### Practice 1'),
    ('has_what_a_lesson_has', '## In practice', '### Question 4\\n\\n## In practice'),
    ('practice_is_backed', 'such as step 4', 'such as a step'),
    ('practice_is_backed', 'such as step 4', 'such as step 9'),
    ('practice_is_backed', 'such as step 4.', 'such as step 4.\\n- It is [so](images/b.png).'),
    ('guesses_are_compared', 'my_guess = guess(', 'print('),
    ('guesses_are_compared', "heard?', my_guess,", "heard?', 5,"),
    ('guesses_are_compared', 'compare_prediction(', 'print('),
    ('exercises_are_checked', '### Exercise 1', '### Exercise 2'),
    ('exercises_are_checked', '"exercise"', '"deck-break"'),
    ('exercises_are_checked', '"check"', '"exercise"'),
    ('exercises_are_checked', '"solution"', '"check"'),
    ('exercises_are_checked', '[not yet] The', '[ok] The'),
    ('exercises_are_checked', '[ok] The', 'The'),
    ('exercises_are_checked', 'Exercise 1 of lesson 90: 0', 'Exercise 1: 0'),
    ('exercises_are_checked', 'Solution of exercise 1: 1', 'Exercise 1 of lesson 90: 1'),
    ('tagged', '"check"', '"chek"'),
    ('tagged', '# Solution of exercise 1', '# A solution'),
    ('tagged', '    "jupyter": {\n     "source_hidden": true\n    },\n', ''),
    ('answers_have_reasons', '### Question 3', '### Question 4'),
    ('answers_have_reasons', '<summary>B. The same', '<summary>C. The same'),
    ('answers_have_reasons', '<summary>B. The same', '<summary>B. The `same`'),
    ('answers_have_reasons', '**No.** On a busy machine it is not.', '**No.**'),
    ('answers_have_reasons', '**No.** On a', 'No: on a'),
    ('answers_have_reasons', '**No.** On a', '**Right.** On a'),
    ('answers_have_reasons', '**Right.** This', '**No.** This'),
    ('answers_have_reasons', '### Question 2', '<details>\\n\\n### Question 2'),
    ('summary_in_languages', '**In short**', 'In short'),
    ('summary_in_languages', 'A node publishes five', 'One. Two. Three. A node publishes five'),
    ('links_lead_somewhere', '99_look_up_a_term.ipynb', '98_look_up_a_term.ipynb'),
    ('executed_in_order', '"execution_count": 3', '"execution_count": null'),
    ('executed_in_order', '"execution_count": 3', '"execution_count": 7'),
]

# A rule, and a cell that breaks it.
ADDED = [
    ('prints_what_stays', printed('warning\n', 'stderr')),
    ('prints_what_stays', printed('saved in /home/ada/plot.csv\n')),
    ('prints_what_stays', printed('file:///tmp/x\n')),
    ('prints_what_stays', printed('lib/python3.11/site-packages/rclpy\n')),
    ('prints_what_stays', printed(r'C:\Users\ada' + '\n')),
    ('prints_what_stays', printed(f'in {FOLDER.parent}\n')),
    ('prints_what_stays', shown(text_html='<a href="/root/x">x</a>')),
    ('prints_what_stays', shown(text_plain='<Axes: >')),
    ('prints_what_stays', shown(text_plain='[<Line2D>]')),
    ('prints_what_stays', shown(text_plain="Text(0, 1, 'a')")),
    ('compared', code('# NBVAL_IGNORE_OUTPUT\n# Not compared: times.\nrun()')),
    ('compared', code('# Not compared:\nrun()', 'nbval-ignore-output')),
    ('compared', code('run()', 'nbval-ignore-output')),
    ('compared', code('# Not compared: slow.\n# NBVAL_SKIP\nrun()')),
    ('compared', code('run()  \n  # NBVAL_RAISES_EXCEPTION')),
    ('pictures_described', shown(text_html='<img alt="A figure.">')),
    ('pictures_described', shown(text_html=f'<img {ALT}> <img {ALT}>')),
    ('pictures_described', shown(text_html='<img src="b">')),
    ('pictures_described', shown(image_png='iVBO')),
    ('pictures_described', new_markdown_cell('![](images/b.png)')),
    ('pictures_described', new_markdown_cell('<img src="images/b.png">')),
    ('names_stay', code('my_guess = 0')),
    ('names_stay', code('%time 1\nfor my_guess in [0]:\n    run()')),
    ('exercises_are_checked', code('run()', 'check')),
    ('tagged', note('Ask first.')),
    ('tagged', new_raw_cell('For the instructor: ask')),
    ('tagged', new_markdown_cell('For the instructor: ask', metadata=note('').metadata)),
    ('fits_a_slide', code('\n'.join(['run()'] * (rules.MAX_CODE_LINES + 1)))),
    ('fits_a_slide', code('%%write a\n' + 'run()\n' * rules.MAX_CODE_LINES)),
    ('fits_a_slide', new_markdown_cell('word ' * (rules.MAX_WORDS + 1))),
    ('fits_a_slide', printed('line\n' * 40)),
    ('links_lead_somewhere', new_markdown_cell('[there](nowhere.ipynb)')),
]


@pytest.mark.parametrize(('rule', 'old', 'new'), CHANGED)
def test_a_template_that_is_changed_breaks_a_rule(rule, old, new):
    assert old in TEXT
    assert rule in complaints(lesson(TEXT.replace(old, new, 1)))


@pytest.mark.parametrize(('rule', 'cell'), ADDED)
def test_a_cell_that_is_added_breaks_a_rule(rule, cell):
    assert rule in complaints(lesson(TEXT, cell))


def test_every_rule_is_broken_once():
    names = {rule.__name__ for rule in rules.EVERY + rules.LESSON}
    assert names == {name for name, *_ in CHANGED + ADDED}


@pytest.mark.parametrize(
    'cell',
    [
        code('# Not compared: times.\nrun()', 'nbval-ignore-output'),
        code('run()\n' * rules.MAX_CODE_LINES),
        code('def run(my_guess):\n    other = [my_guess for my_guess in other]'),
        printed('/dev/shm is empty; the topic /worker, 1/tmp, and/or\n'),
        printed('    python3/site-packages/my_pkg/\n'),
        shown(text_plain='<t>', text_html='t'),
        shown(text_html=f'<img {ALT} src="data:image/png;base64,iVBO+0xabcdef/tmp/AA">'),
        new_markdown_cell('| word <b>|</b>' * rules.MAX_WORDS),
        new_markdown_cell('```python\n# a comment, no heading\n```'),
        note('For the instructor: ask first'),
    ],
)
def test_what_is_allowed_breaks_no_rule(cell):
    assert complaints(lesson(TEXT, cell)) <= {'executed_in_order'}


@pytest.mark.parametrize(
    'backed',
    [
        'steps 3 and 4',
        '[QoS](https://docs.ros.org/en/jazzy/)',
        '[99 Look up a term](99_look_up_a_term.ipynb)',
        'this:\\n  what [docs](https://docs.python.org/3.12/) say',
    ],
)
def test_what_backs_a_bullet_of_in_practice(backed):
    assert rules.problems(lesson(TEXT.replace('step 4.', f'{backed}.', 1))) == []


@pytest.mark.parametrize('right', ['AAA', 'BBB'])
def test_who_always_gives_one_answer_is_not_always_right(right):
    text = TEXT.replace('**Right.**', '**No.**')
    pieces = text.split('**No.**')
    order = ''.join('ABC'.replace(letter, 'r') for letter in right)
    text = pieces[0] + ''.join(
        ('**Right.**' if kind == 'r' else '**No.**') + piece
        for kind, piece in zip(order, pieces[1:], strict=True)
    )
    assert complaints(lesson(text)) == {'answers_have_reasons'}


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('lang="vi"', 'lang="de"'),
        (' dir="rtl"', ''),
        ('<details lang="fr">', '<details lang="fr" dir="rtl">'),
        ('écoute.', 'écoute. Une. Deux. Trois.'),
        ('<bdi dir="ltr">C++</bdi>', 'C++'),
    ],
)
def test_a_broken_translation_is_reported(old, new):
    text = '\n\n'.join([FRENCH, URDU, VIETNAMESE])
    assert text.count(old) == 1
    assert complaints(translated(text.replace(old, new))) == {'summary_in_languages'}


def test_the_numbers_of_the_notebooks():
    def built(*files):
        return rules.problems_of_all([lesson(file=file) for file in files])

    assert built('00_start_here.ipynb', '01_lose.ipynb') != []
    for files in (['00_a', '02_b'], ['01_a', '02_b'], ['00_a', '00_b'], ['00_a', '01-b']):
        assert built(*(f'{file}.ipynb' for file in files))


@pytest.mark.parametrize(
    ('asked', 'found'),
    [
        ('Ask for the rule of lesson 91.', ''),
        ('It is lesson 92.', 'not in two hours'),
        ('Lesson 93 has the rule.', ''),
        ('Lesson 94 says more.', 'comes later'),
    ],
)
def test_a_note_names_what_its_timetables_have_shown(asked, found):
    def built(number, timetables, *cells):
        text = TEXT.replace('Part: nodes', f'Part: nodes\\nTimetables: {timetables}')
        return lesson(text, *cells, file=f'{number}_a.ipynb')

    lessons = [
        built('91', 'the first of two days, two hours'),
        built('92', 'the first of two days'),
        built('93', 'the second of two days, two hours', note(asked)),
    ]
    sentences = list(rules.notes_name_what_was_shown(lessons))
    assert len(sentences) == bool(found)
    assert all(found in sentence for sentence in sentences)


@pytest.mark.parametrize(
    ('old', 'new', 'what'),
    [
        ('nœud', '', 'is not term'),
        ('lang="vi"', 'lang="fr"', 'is not term'),
        ('dir="rtl" ', '', 'is not term'),
        ('| **node** |', '| **deadlock** |', 'never says deadlock'),
        ('| **topic** |', '| **node** |', 'stands twice'),
        ('نوڈ', 'node', 'ur: write <bdi'),
        ('nút (node)', 'bên (node)', 'stands after another word'),
    ],
)
def test_a_broken_glossary_is_reported(old, new, what):
    notebook = nbformat.reads(nbformat.writes(GLOSSARY.notebook), as_version=4)
    for cell in notebook.cells:
        cell.source = cell.source.replace(old, new)
    others = lessons()[:-1]
    assert list(rules.glossary_fits(GLOSSARY, others)) == []
    found = list(rules.glossary_fits(Lesson(GLOSSARY.file, notebook), others))
    assert any(what in sentence for sentence in found)
