"""The questions from memory: what a student reads, what is kept, and the questions themselves."""

import re
from collections import Counter
from itertools import pairwise

import pytest

from helpers.checks import memory, progress, remember
from helpers.lesson import lessons, names_of_memory
from tools.lessons.new import template

BANK = memory.questions()
LESSONS = {lesson.name: lesson for lesson in lessons()}
FIRST, SECOND, *_ = BANK  # of lesson 03, about lessons 01 and 02
ASKED = [
    (name, lesson)
    for lesson in LESSONS.values()
    for cell in lesson.notebook.cells
    for name in sorted((cell.cell_type == 'code' and names_of_memory(cell.source)) or ())
]


@pytest.fixture(autouse=True)
def kept(tmp_path, monkeypatch):
    """The progress file of this test's student, who begins in lesson 03."""
    path = tmp_path / 'data' / 'progress.txt'
    monkeypatch.setenv(progress.FILE_VARIABLE, str(path))
    at(monkeypatch, 'run_callbacks_in_parallel')
    return path


def at(monkeypatch, name):
    monkeypatch.setenv('JPY_SESSION_NAME', f'notebooks/{LESSONS[name].file}')


def said(capsys, **answers):
    remember(**answers)
    return capsys.readouterr().out


def wrong(name):
    return 'B' if BANK[name].right != 'B' else 'C'


def test_dots_print_the_questions_and_make_no_file(capsys, kept, monkeypatch):
    text = said(capsys, **{FIRST: ..., SECOND: ...})
    for name in (FIRST, SECOND):
        assert BANK[name].question in ' '.join(text.split())
        assert all(f'  {letter}. ' in text for letter in 'ABC')
        assert BANK[name].why not in text
    assert text.endswith(f'\n\n{memory.HOW}\n')
    assert not kept.exists()
    for file in ('', str(kept.parent)):  # none is kept, and one that cannot be read
        monkeypatch.setenv(progress.FILE_VARIABLE, file)
        assert said(capsys, **{FIRST: ..., SECOND: ...}) == text


def test_an_answer_gets_its_reason_and_its_place(capsys, kept):
    number = LESSONS[BANK[FIRST].lesson].number
    text = ' '.join(said(capsys, **{FIRST: BANK[FIRST].right.lower()}).split())
    assert f'Right. {BANK[FIRST].why} Lesson {number}, step {BANK[FIRST].step}, shows it.' in text
    assert memory.HOW not in text
    assert not kept.exists()
    text = ' '.join(said(capsys, **{FIRST: wrong(FIRST), SECOND: ...}).split())
    assert f'No, it is {BANK[FIRST].right}. {BANK[FIRST].why}' in text
    assert text.endswith(memory.HOW)


def test_the_number_is_that_of_the_notebook_today(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for file in ('00_start_here', f'42_{BANK[FIRST].lesson}'):
        (tmp_path / f'{file}.ipynb').touch()
    assert 'Lesson 42, step' in said(capsys, **{FIRST: 'A'})
    assert 'The lesson "lose messages", step' in ' '.join(said(capsys, **{SECOND: 'A'}).split())


@pytest.mark.parametrize('answer', ['D', '', 3, True, ['A'], 'both'])
def test_what_is_no_letter_gets_a_sentence(capsys, kept, answer):
    text = said(capsys, **{FIRST: answer})
    assert f"Please change {answer!r}: the answer is 'A', 'B' or 'C'." in text
    assert not kept.exists()


def test_an_unknown_question_gets_a_sentence(capsys):
    assert said(capsys, who_are_you='A') == (
        'There is no question called who_are_you: copy its name again.\n'
    )


def test_a_miss_comes_back_in_a_later_lesson_until_it_is_right_there(capsys, kept, monkeypatch):
    back = 'From before, a question that you have missed:'
    for _ in range(2):
        assert back not in said(capsys, **{FIRST: wrong(FIRST)})
    said(capsys, **{FIRST: BANK[FIRST].right})  # after reading the answer: this does not count
    assert kept.read_text() == f'memory {FIRST} run_callbacks_in_parallel\n'
    at(monkeypatch, BANK[FIRST].lesson)  # not in the lesson that answers it
    assert back not in said(capsys)

    at(monkeypatch, 'keep_what_is_fresh')
    text = said(capsys, which_thread_calls=...)
    assert text.index(back) > text.index(memory.HOW)
    assert text.endswith(f"write it into the parentheses: {FIRST}='A'\n")
    assert back not in said(capsys, **{FIRST: wrong(FIRST)})
    at(monkeypatch, 'run_a_long_job')
    assert back in said(capsys)
    assert back not in said(capsys, **{FIRST: BANK[FIRST].right})
    at(monkeypatch, 'make_a_package')
    assert back not in said(capsys)
    assert progress.table(progress.with_tasks(), kept.read_text().splitlines()).count(' 0 of ') > 9


def test_one_miss_comes_back_at_a_time(capsys, monkeypatch):
    said(capsys, **{SECOND: wrong(SECOND), FIRST: wrong(FIRST)})
    at(monkeypatch, 'keep_what_is_fresh')
    text = said(capsys)
    assert f"{SECOND}='A'" in text
    assert f"{FIRST}='A'" not in text
    assert f"{FIRST}='A'" in said(capsys, **{SECOND: BANK[SECOND].right})


# --- The questions -------------------------------------------------------------------------------


def test_each_question_is_asked_once():
    [of_the_template] = [
        found for cell in template().cells if (found := names_of_memory(cell.source))
    ]
    calls = Counter(name for name, _ in ASKED)
    assert {name for name, count in calls.items() if count > 1} == set()
    assert of_the_template & calls.keys() == set(), 'Write two questions of your own.'
    assert calls.keys() | of_the_template == BANK.keys()


@pytest.mark.parametrize('name', BANK)
def test_a_question_is_about_a_step_of_an_earlier_lesson(name):
    question = BANK[name]
    about = LESSONS[question.lesson]
    assert str(question.step) in about.steps
    assert all(about.number < lesson.number for asked, lesson in ASKED if asked == name)


@pytest.mark.parametrize(('name', 'lesson'), ASKED, ids=[name for name, _ in ASKED])
def test_no_cell_before_a_question_has_its_answer(name, lesson):
    answer = BANK[name].options[BANK[name].right].rstrip('.').casefold()
    for cell in lesson.notebook.cells:
        if cell.cell_type == 'code':
            return
        assert not re.search(rf'\b{re.escape(answer)}\b', cell.source.casefold()), cell.id


def test_questions_are_short_and_their_options_differ():
    for name, question in BANK.items():
        assert len(set(question.options.values())) == 3, name
        assert question.right in question.options, name
        assert len(question.question.split()) < 45, name
        text = ' '.join([question.question, question.why, *question.options.values()])
        assert not re.search(r'\blessons? \d', text, re.IGNORECASE), name


def test_the_right_letters_are_spread():
    letters = [question.right for question in BANK.values()]
    assert min(Counter(letters).values()) >= len(letters) // 3 - 1
    assert sum(one == other for one, other in pairwise(letters)) < len(letters) / 3
