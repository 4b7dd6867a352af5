"""The class: what its server takes, what it refuses, and what its page says."""

import json
import os
import re
import socket
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from classroom.class_page.addresses import in_networks
from classroom.class_page.events import plain_name
from classroom.class_page.lessons import Known
from classroom.class_page.store import BARS, WORDS, ClassStore, bars
from classroom.class_page.web import NEW_A_MINUTE, WRONG_A_MINUTE
from classroom.tests.support.classes import (
    LATER,
    NAME,
    OTHER,
    QUESTION,
    STEP,
    TASK,
    WEB,
    event,
    running_class,
    write_lesson,
)
from helpers.checks.classroom import BATCH
from helpers.lesson import lessons, outline, path_of

CLASS = [sys.executable, '-m', 'classroom.class_page']


@pytest.fixture
def store(tmp_path):
    """Yield the events of a class, without a server."""
    write_lesson(tmp_path)
    known = [Known(lesson) for lesson in lessons(tmp_path / 'notebooks')]
    made = ClassStore(tmp_path / 'class' / 'class.sqlite', known)
    yield made
    made.close()


# --- What is counted -----------------------------------------------------------------------------


def test_the_last_guess_of_a_seat_counts_once(opened):
    ada, bob = opened.join(), opened.join()
    for _ in range(2):  # the answer did not arrive, and all is told again
        assert opened.tell(ada, event(number=1, value=3), event(number=2, value=5)) == ''
    assert opened.tell(bob, event(number=1, value=3)) == ''
    assert opened.tell(ada, event(number=1, value=99)) == ''  # replayed, with another value
    assert opened.bars() == {'3': 1, '5': 1}
    assert len(opened.events()) == 3


def test_only_what_the_lesson_has_is_counted(opened):
    ada = opened.join()
    unknown = {
        'question': event(question='What is your name?'),
        'task': event('task', task='take_it', solved=True),
        'cell': event('cell', cell='my own'),
        'lesson': event() | {'lesson': 'lose_keys'},
    }
    for what, message in unknown.items():
        assert opened.tell(ada, message).endswith(f'no such {what}.')
    assert opened.tell(ada, unknown['cell'], event(number=1)).endswith('no such cell.')
    assert len(opened.events()) == 1


def test_hidden_answers_do_not_leave_the_server(opened):
    opened.tell(opened.join(), event(value='a secret'))
    assert opened.view()['guesses'][0]['answered'] == 1
    assert 'a secret' not in json.dumps(opened.view())
    opened.do('show', question=QUESTION)
    assert 'a secret' in json.dumps(opened.view())
    opened.do('hide', question=QUESTION)
    assert 'a secret' not in json.dumps(opened.view())


def test_steps_tasks_hands_and_notes(opened):
    seats = [opened.join(name=name) for name in ('Ada', '')]
    before = opened.view()['seats']
    for seat in seats:
        opened.tell(seat, event('cell', 1, cell=STEP), event('hand', 2, up=True))
    opened.tell(seats[0], event('cell', 3, cell=LATER))
    opened.tell(seats[0], event('task', 4, task=TASK, solved=False))
    opened.tell(seats[1], event('task', 4, task=TASK, solved=True))
    opened.tell(seats[1], event('task', 5, task=TASK, solved=False))
    view = opened.view()
    assert [step['here'] for step in view['steps']] == [0, 1, 1]
    assert view['tasks'] == [{'number': 1, 'solved': 1, 'tried': 1, 'open': before - 2}]
    assert [hand['name'] for hand in view['hands']] == ['Ada', '']
    assert 'Ask <strong>before</strong> the run.' in view['notes']
    opened.do('lower', seat=view['hands'][0]['seat'])
    assert [hand['name'] for hand in opened.view()['hands']] == ['']


def test_who_has_solved_which_of_a_task_that_differs(opened):
    ada, other = opened.join(name='Ada'), opened.join()
    for number in (1, 2):
        opened.tell(ada, event('about', number, about='plain_twist', task=TASK))
    opened.tell(other, event('about', 3, about='slow_look', task=TASK))
    seat = opened.view()['about'][1]['tasks'][0]['who'][0]
    assert opened.view()['about'] == [
        {'about': 'plain_twist', 'tasks': [{'number': 1, 'who': ['Ada']}]},
        {'about': 'slow_look', 'tasks': [{'number': 1, 'who': [seat]}]},
    ]
    assert seat.startswith('seat ')


def test_a_task_of_version_0_3_is_known_by_its_number(tmp_path):
    """A student's computer, or a class that was broken off, may still have 0.3."""
    lesson = outline(path_of('lose_messages'))
    file = tmp_path / 'class.sqlite'
    store = ClassStore(file, [Known(lesson)])
    seat = store.join('ada', '')
    told = event('task', 1, task=4, solved=True) | {'lesson': lesson.name}
    assert store.take(seat, [told]) == ''
    with store._db as db:
        db.execute("UPDATE events SET what = '4'")
    store.close()
    store = ClassStore(file, [Known(lesson)])
    solved = [task['number'] for task in store.view('lose_messages', 0)['tasks'] if task['solved']]
    assert solved == [lesson.tasks[3].number]
    assert lesson.tasks[3].name == 'be_the_queue'
    store.close()


def test_a_task_that_has_moved_is_one_of_its_lesson_of_today(tmp_path):
    """Of a student with older lessons, and of a class that was broken off before they moved."""
    names = ('build_a_robot_program', 'put_a_program_on_a_robot')
    before, now = (outline(path_of(name)) for name in names)
    file, question = tmp_path / 'class.sqlite', now.guesses[0].question
    known = [Known(before), Known(now)]
    store = ClassStore(file, known)
    tokens = {name: store.join(name, '') for name in ('ada', 'bo')}
    told = [
        event('task', 1, task='the_guard', solved=True) | {'lesson': before.name},
        event('guess', 2, question=question, value=1.0) | {'lesson': before.name},
        event('cell', 3, cell='guard-check') | {'lesson': before.name},
    ]
    assert store.take(tokens['ada'], told) == ''
    assert store.take(tokens['bo'], [one | {'lesson': now.name} for one in told]) == ''
    assert {lesson for _, lesson, _ in store._latest('task')} == {now.name}
    with store._db as db:
        db.execute('UPDATE events SET lesson = ?', (before.name,))
    store.close()
    store = ClassStore(file, known)
    for kind in ('task', 'guess'):
        assert [lesson for _, lesson, _ in store._latest(kind)] == [now.name] * 2
    store.close()


def test_a_guess_is_shown_until_it_is_compared(opened):
    opened.tell(opened.join(), event(value=41), event('outcome', 1, question=QUESTION, value=14))
    for step, questions in enumerate([[], [QUESTION, OTHER], [QUESTION]]):
        opened.go(step)
        assert [one['question'] for one in opened.view()['guesses']] == questions
    assert opened.bars() == {'14': 0, '41': 1}
    assert opened.view()['guesses'][0]['cells'] == [STEP, LATER]
    opened.go(1)
    assert opened.bars(OTHER) == {}


def walk(opened, cell, began_s):
    """Tell what the deck tells when it comes to a cell."""
    minutes = {'own': 4, 'planned': 6, 'all': 9}
    slide = {'lesson': NAME, 'cell': cell, 'began_s': began_s, **minutes}
    assert opened.do('slide', **slide) == 200


def test_the_page_follows_the_deck_and_the_instructor(opened):
    began_s = time.time() - 600
    walk(opened, LATER, began_s)
    view = opened.view()
    assert (view['step'], view['gone']) == ('2. Look', 10)
    assert [view[name] for name in ('own', 'planned', 'all')] == [4, 6, 9]
    opened.go(0)
    assert opened.view()['step'] == '02 Lose messages'
    assert opened.view()['all'] == 4  # of the lesson
    walk(opened, 'title', None)
    assert opened.view()['gone'] == 0
    walk(opened, STEP, began_s)
    assert opened.view()['step'] == '1. Count'


@pytest.mark.parametrize(
    'wrong', [{}, {'lesson': 'lose_keys'}, {'began_s': 'now'}, {'own': -1}, {'more': 1}]
)
def test_a_slide_of_another_form_is_refused(opened, wrong):
    opened.go(1)
    minutes = {'own': 4, 'planned': 6, 'all': 9}
    slide = {'lesson': NAME, 'cell': LATER, 'began_s': None, **minutes} | wrong
    if not wrong:
        del slide['cell']
    assert opened.do('slide', **slide) == 400
    assert opened.view()['step'] == '1. Count'


def test_a_seat_that_leaves_is_forgotten(opened):
    ada = opened.join(name='Ada')
    opened.tell(ada, event(), event('hand', 1, up=True))
    assert opened.post('leave', {}, ada) == (200, {})
    assert opened.events() == opened.view()['hands'] == []
    assert opened.post('events', {'events': [event()]}, ada)[0] == 403


ANSWERS = st.integers(-(2**53), 2**53) | st.floats(-(2**53), 2**53) | st.text(max_size=9)


@given(
    st.lists(ANSWERS | st.sampled_from(['41', '11,5', 'None', '🤖'])), st.lists(ANSWERS, max_size=1)
)
def test_bars_count_each_answer_once_and_are_few(answers, measured):
    shown = bars(answers, measured)
    assert sum(bar['count'] for bar in shown) == len(answers)
    assert len(shown) <= BARS
    assert [bar['right'] for bar in shown].count(True) == len(measured)


def test_bars_of_forty_students_show_what_most_have_said():
    answers = [41] * 9 + ['41', '41 '] + [14] * 6 + [10] * 5 + [40] * 3 + [12, 13, 15, 18, 20]
    answers += [41_000_000, '11,5', '11.5', 'None', 'I do not know', '🤖', '', 7, 8, 9]
    shown = [(bar['label'], bar['count'], bar['right']) for bar in bars(answers, [14])]
    assert shown == [
        ('10', 5, False),
        ('11.5', 2, False),
        ('13', 1, False),
        ('14', 6, True),
        ('15', 1, False),
        ('40', 3, False),
        ('41', 11, False),
        ('other', 11, False),
    ]
    texts = ['reliable'] * 3 + ['Reliable', 'best effort', 'both', 7]
    assert [(bar['label'], bar['count']) for bar in bars(texts)][0] == ('reliable', 4)
    assert bars([1, 2], [14])[-1] == {'label': '14', 'count': 0, 'right': True}


def test_an_answer_can_be_taken_out_of_sight(opened):
    ada, bob = opened.join(), opened.join()
    opened.tell(ada, event(value=41))
    opened.tell(bob, event(value='something rude'))
    opened.go(1)
    assert opened.bars() == {'41': 1, 'something rude': 1}
    assert opened.do('remove', question=QUESTION, answer='Something rude') == 200
    assert opened.bars() == {'41': 1}
    assert opened.do('remove', question=QUESTION) == 400


# --- What is refused -----------------------------------------------------------------------------


ATTACKS = [
    *(event() | {'id': bad} for bad in ['', 'x' * 16, '0' * 15, '0' * 16 + '\n', 0, None]),
    *(event(value=bad) for bad in ['x' * 201, None, 2**60, [[1]], [0] * 21, {'a': 1}]),
    *(event(value=unseen) for unseen in ['a\u202eb', 'a\nb', '\0']),
    event(question="'); DROP TABLE events; --"),
    *(event() | {'kind': kind} for kind in ['', None, {}, 'cell', '__class__']),
    *(event() | {extra: 1} for extra in ['seat', 'at_s', '__proto__']),
    *({k: v for k, v in event().items() if k != missing} for missing in event()),
    *(event('task', task=n, solved=True) for n in [-1, 1.5, '1', 2**70, True]),
    event('task', task=TASK, solved=1),
    event('about', about=3, task=TASK),
    event('hand', up='yes'),
    event('cell', cell='../..'),
    event() | {'lesson': '../02'},
    *(None, 1, 'guess', [], [event()], {}, True),
]
BODIES = [
    *(b'', b'{', b'null', b'1', b'{"events": 1}', b'{"events": [NaN]}', b'\xff\xfe', b'a=1&b=2'),
    *(b'{"events": [], "more": 1}', b'[' * 100_000, b'{"events": [' + b'1,' * 60 + b'1]}'),
    *(b'{"events": ["\\ud800"]}', b'{"events": [1' + b'0' * 9999 + b']}'),
]


def test_attacks_on_the_form_of_an_event(store):
    seat = store.join('ada', '')
    for attack in ATTACKS:
        said = store.take(seat, [attack])
        assert re.fullmatch(r'[A-Z][^.]*\.', said), attack
    assert store.view(NAME, 1)['guesses'][0]['answered'] == 0
    assert store.view(NAME, 1)['hands'] == []


def test_attacks_on_the_form_of_a_message(opened):
    ada = opened.join()
    for body in BODIES:
        status, answer = opened.post('events', body, ada)
        assert (status, list(answer)) == (400, ['error']), body
        assert answer['error'].startswith('This is no message to a class: it '), body
        assert opened.post('join', body)[0] == 400
    assert opened.events() == []
    assert opened.tell(ada, event()) == ''


def test_no_answer_tells_one_student_about_another(opened):
    ada, bob = opened.join(name='Ada'), opened.join()
    opened.tell(ada, event(value='what Ada says'))
    answers = [
        opened.post(path, body, bob)
        for path in ('events', 'join', 'leave')
        for body in ({'events': [event()]}, {'code': opened.code, 'name': ''}, {}, b'')
    ]
    assert 'Ada' not in json.dumps(answers)
    assert ada not in json.dumps(answers)


def test_the_page_needs_the_secret(opened):
    own, secret, _ = opened.page.rsplit('/', 2)
    for path in ('', 'live', 'slide', 'class.js'):
        for wrong in (secret[:-1], secret + 'x', secret.upper() + 'A', 'x', opened.code):
            answer = WEB.get(f'{own}/{wrong}/{path}')
            assert answer.json() == {'error': 'This cannot be answered (404).'}
    assert opened.post(f'{secret[:-1]}/end', {})[0] == 404
    for path in ('', 'class.sqlite', secret, f'{secret}/store.py'):
        assert WEB.get(f'{own}/{path}').status_code == 404, path
    page = WEB.get(opened.page)
    assert "default-src 'self'" in page.headers['Content-Security-Policy']
    assert page.headers['Cache-Control'] == 'no-store'


# --- Fast, wrong, and too often ------------------------------------------------------------------


def test_a_loud_seat_waits_and_a_quiet_one_is_heard(opened):
    loud, quiet = opened.join(), opened.join()
    while opened.post('events', {'events': [None] * BATCH}, loud)[0] == 200:
        pass
    assert opened.post('events', {'events': [None] * BATCH}, loud)[0] == 429
    assert opened.tell(quiet, event()) == ''


def test_codes_that_are_wrong_are_few_a_minute(tmp_path):
    with running_class(tmp_path) as opened:
        codes = [f'blue-otter-{n}' for n in range(2 * WRONG_A_MINUTE)]
        tries = [opened.post('join', {'code': code, 'name': ''}) for code in codes]
        assert [status for status, _ in tries] == [401] * WRONG_A_MINUTE + [429] * WRONG_A_MINUTE
        assert opened.post('join', {'code': opened.code, 'name': ''})[0] == 429
    assert len(set(WORDS)) ** 3 == 2**24
    assert all(re.fullmatch('[a-z]{3,8}', word) for word in WORDS)


# --- How it starts and ends ----------------------------------------------------------------------


def test_a_port_that_is_taken(tmp_path):
    write_lesson(tmp_path)
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = taken.getsockname()[1]
        command = [*CLASS, '--root', tmp_path, '--no-browser']
        done = subprocess.run([*command, '--port', str(port)], capture_output=True, text=True)
    assert done.returncode == 1
    said = f'Port {port} cannot be used (Address already in use). Is another class open? '
    assert done.stderr == f'{said}Name another one: make class PORT={port + 1}\n'


def test_a_second_class_here_does_not_begin(tmp_path):
    with running_class(tmp_path) as first:
        second = subprocess.run(
            [*CLASS, '--root', tmp_path, '--no-browser'],
            env=os.environ | {'JUPYTER_CONFIG_DIR': str(tmp_path / 'jupyter')},
            capture_output=True,
            text=True,
        )
        assert (second.returncode, second.stdout) == (1, '')
        assert second.stderr == 'A class is open here already: Ctrl+C in its terminal ends it.\n'
        assert first.tell(first.join(), event()) == ''


def test_who_can_reach_it(opened, tmp_path):
    """The wall has the address of this machine in its network: others may come and go."""
    assert 'Only this machine can join. LAN=yes lets' in opened.said
    if not in_networks():
        pytest.skip('This machine is in no network.')
    with running_class(tmp_path / 'wide', '--lan') as wide:
        assert 'Only this machine' not in wide.said
        host = wide.address.partition(':')[0]
        assert not host.startswith('127.')
        socket.create_connection((host, wide.port), timeout=5).close()
        with pytest.raises(OSError, match='refused'):
            socket.create_connection((host, opened.port), timeout=5)


def test_forgetting_leaves_nothing_in_the_file(store):
    seat = store.join('ada', 'Ada Lovelace')
    store.take(seat, [event(value='what was said')])
    store.forget()
    for path in store.file.parent.iterdir():
        assert b'Lovelace' not in path.read_bytes(), path
        assert b'what was said' not in path.read_bytes(), path
    assert store.take(seat, [event(number=1)]) == ''


# --- Who is in the class --------------------------------------------------------------------------


def test_a_seat_that_is_taken_out_stays_away_also_after_a_crash(tmp_path):
    with running_class(tmp_path) as opened:
        ada, bob = opened.join(name='Ada'), opened.join(name='Bob')
        opened.tell(ada, event(value='something rude'))
        [seat] = [one['seat'] for one in opened.view()['people'] if one['name'] == 'Ada']
        assert opened.do('send_away', seat=seat) == 200
        assert opened.events() == []
        for _ in range(2):
            status, answer = opened.post('join', {'code': opened.code, 'name': 'Ada'}, ada)
            assert (status, 'speak with your teacher' in answer['error']) == (400, True)
            assert opened.post('events', {'events': [event()]}, ada)[0] == 403
            assert opened.tell(bob, event(value=7)) == ''
            assert [one['name'] for one in opened.view()['people']] == ['Bob']
            opened.kill()
            opened.start()


def test_what_was_taken_out_of_sight_stays_so_after_a_crash(tmp_path):
    with running_class(tmp_path) as opened:
        opened.tell(opened.join(), event(value='Something rude'))
        opened.go(1)
        assert opened.do('remove', question=QUESTION, answer='Something rude') == 200
        opened.kill()
        opened.start()
        opened.go(1)
        assert opened.bars() == {}


def test_nobody_new_joins_a_closed_class(opened):
    ada = opened.join()
    assert opened.do('close_door') == 200
    status, answer = opened.post('join', {'code': opened.code, 'name': ''})
    assert (status, 'nobody new' in answer['error']) == (400, True)
    assert opened.view()['closed']
    assert opened.tell(ada, event()) == ''
    assert opened.do('open_door') == 200
    assert opened.join()


def test_one_address_fills_no_class(opened):
    answers = [opened.post('join', {'code': opened.code, 'name': ''})[0] for _ in range(200)]
    assert answers == [200] * NEW_A_MINUTE + [429] * (200 - NEW_A_MINUTE)


def test_behind_a_proxy_each_student_has_an_address(tmp_path):
    with running_class(tmp_path, '--url', 'https://class.example.org/') as opened:
        assert opened.address == 'https://class.example.org'
        body = json.dumps({'code': opened.code, 'name': ''})

        def join(address):
            headers = {'X-Forwarded-For': address}
            return WEB.post(f'{opened.url}/join', body, headers=headers).status_code

        assert [join('192.0.2.1') for _ in range(NEW_A_MINUTE + 1)][-2:] == [200, 429]
        assert join('192.0.2.2') == 200


@pytest.mark.parametrize(
    ('name', 'shown'),
    [
        ('Zoë', 'Zoë'),
        ('Nguyễn Thị Ánh', 'Nguyễn Thị Ánh'),
        ('محمد علی', 'محمد علی'),
        ('علی‌رضا', 'علی‌رضا'),  # hangs together by a letter that nobody sees
        ('क्षत्रिय', 'क्षत्रिय'),
        ('李明', '李明'),
        ('👩‍🚀 Mae', '👩‍🚀 Mae'),
        (' Ada\u200b\u202e \n Lovelace ', 'Ada Lovelace'),
        ('क्षत्रि' * 10, 'क्षत्रि' * 10),  # 30 letters, with more signs above and below
    ],
)
def test_a_name_has_any_letters(name, shown):
    assert plain_name(name) == shown


def test_a_name_that_is_too_long_is_refused_in_one_sentence(opened):
    status, answer = opened.post('join', {'code': opened.code, 'name': 'x' * 41})
    assert (status, answer['error']) == (
        400,
        'A name has 40 letters at most, and this one has 41: take a shorter one.',
    )
    assert opened.view()['people'] == []
