"""The class: what its server takes, what it refuses, and what its page says."""

import contextlib
import csv
import json
import os
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.classes import (
    LATER,
    NAME,
    OTHER,
    QUESTION,
    STARTED,
    STEP,
    event,
    running_class,
    student,
    write_lesson,
)
from support.machines import ADDRESSES, ended, two_machines
from support.waits import START_LIMIT_S, wait_for

from helpers.classroom import HUB_VARIABLE
from tools.addresses import in_networks
from tools.class_server.__main__ import main
from tools.class_server.lessons import Known
from tools.class_server.store import BARS, EVENTS_OF_SEAT, SEATS, WORDS, Class, bars
from tools.class_server.web import EVENTS_AT_ONCE, WRONG_A_MINUTE, Room
from tools.lessons.lesson import lessons
from tools.lessons.present import DECK

# As much as the machine of the tests has time for. CUT_S=60 MESSAGES=2000 is the whole measure.
CUT_S = float(os.environ.get('CUT_S', '12'))  # longer than a message waits for its answer
MESSAGES = int(os.environ.get('MESSAGES', '200'))

REAL = [Known(lesson) for lesson in lessons() if lesson.is_lesson]


def made_store(folder):
    """Yield the events of a class, without a server."""
    write_lesson(folder)
    known = [Known(lesson) for lesson in lessons(folder / 'notebooks')]
    made = Class(folder / 'class' / 'class.sqlite', known)
    yield made
    made.close()


@pytest.fixture
def store(tmp_path):
    yield from made_store(tmp_path)


@pytest.fixture(scope='module')
def one_class_store(tmp_path_factory):
    yield from made_store(tmp_path_factory.mktemp('store'))


def refused(url, data=None, **headers):
    """Return the status with which an address refuses, and its sentence."""
    with pytest.raises(urllib.error.HTTPError) as answer:
        urllib.request.urlopen(urllib.request.Request(url, data, headers))
    return answer.value.code, json.load(answer.value)['error']


# --- What is counted -----------------------------------------------------------------------------


def test_the_last_guess_of_each_seat_is_counted_and_each_event_once(opened):
    ada, bob = opened.join(), opened.join()
    for _ in range(2):  # the answer did not arrive, and all is told again
        assert opened.tell(ada, event(number=1, value=3), event(number=2, value=5)) == ''
    assert opened.tell(bob, event(number=1, value=3)) == ''
    assert opened.tell(ada, event(number=1, value=99)) == ''  # replayed, with another value
    assert opened.bars() == {'3': 1, '5': 1}
    assert len(opened.csv()) == 4


def test_only_what_the_lesson_has_is_counted(opened):
    ada = opened.join()
    unknown = {
        'question': event(question='What is your name?'),
        'exercise': event('exercise', exercise=2, solved=True),
        'cell': event('cell', cell='my own'),
        'lesson': event() | {'lesson': 'lose_keys'},
    }
    for what, message in unknown.items():
        assert opened.tell(ada, message).endswith(f'no such {what}.')
    assert opened.tell(ada, unknown['cell'], event(number=1)).endswith('no such cell.')
    assert len(opened.csv()) == 2


def test_hidden_answers_do_not_leave_the_server(opened):
    opened.tell(opened.join(), event(value='a secret'))
    assert opened.view()['guesses'][0]['answered'] == 1
    assert 'a secret' not in json.dumps(opened.view())
    opened.do('show', question=QUESTION)
    assert 'a secret' in json.dumps(opened.view())
    opened.do('hide', question=QUESTION)
    assert 'a secret' not in json.dumps(opened.view())


def test_steps_exercises_hands_and_notes(opened):
    seats = [opened.join(name=name) for name in ('Ada', '')]
    before = opened.view()['seats']
    for seat in seats:
        opened.tell(seat, event('cell', 1, cell=STEP), event('hand', 2, up=True))
    opened.tell(seats[0], event('cell', 3, cell=LATER))
    opened.tell(seats[0], event('exercise', 4, exercise=1, solved=False))
    opened.tell(seats[1], event('exercise', 4, exercise=1, solved=True))
    opened.tell(seats[1], event('exercise', 5, exercise=1, solved=False))
    view = opened.view()
    assert [step['here'] for step in view['steps']] == [0, 1, 1]
    assert view['exercises'] == [{'number': 1, 'solved': 1, 'tried': 1, 'open': before - 2}]
    assert [hand['name'] for hand in view['hands']] == ['Ada', '']
    assert 'Ask <strong>before</strong> the run.' in view['notes']
    opened.do('lower', seat=view['hands'][0]['seat'])
    assert [hand['name'] for hand in opened.view()['hands']] == ['']


def test_a_guess_is_shown_from_where_it_is_asked_to_where_it_is_compared(opened):
    """The value that the cell holds is marked: it may be there because nobody wrote a guess."""
    opened.tell(opened.join(), event(value=41), event('outcome', 1, question=QUESTION, value=14))
    for step, questions in enumerate([[], [QUESTION, OTHER], [QUESTION]]):
        opened.go(step)
        assert [one['question'] for one in opened.view()['guesses']] == questions
    assert opened.bars() == {'41': 1}
    assert opened.view()['guesses'][0]['cells'] == [STEP, LATER]
    assert opened.view()['guesses'][0]['given'] == '41'
    opened.go(1)
    assert opened.bars(OTHER) == {}
    assert opened.view()['guesses'][1]['given'] == '2, 10'  # a set, as students' computers send it


def walk(opened, place):
    """Write what presenter.js writes when the deck comes to a cell."""
    path = f'presentation/02_{NAME}.ipynb'
    began = {path: time.time() - 600} if place else {}  # the minutes begin after the first slide
    deck = {'data': {'current': path, 'places': {path: place}, 'began': began}}
    file = opened.folder / 'jupyter/lab/workspaces' / DECK
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(deck))


def test_the_page_follows_the_deck_and_the_instructor(opened):
    walk(opened, 7)
    opened.wait_for(lambda view: view['step'] == '2. Look')
    assert opened.view()['gone'] == 10
    opened.go(0)
    assert opened.view()['step'] == '02 Lose messages'
    walk(opened, 0)
    opened.wait_for(lambda view: view['gone'] == 0)
    walk(opened, 2)
    opened.wait_for(lambda view: view['step'] == '1. Count')


def test_after_a_crash_the_page_is_where_the_slides_are(tmp_path):
    with running_class(tmp_path) as opened:
        opened.tell(opened.join(), event())
        walk(opened, 7)
        opened.kill()
        opened.start()
        view = opened.view()
    assert (view['step'], view['gone'], view['guesses'][0]['answered']) == ('2. Look', 10, 1)


def test_a_seat_that_leaves_is_forgotten(opened):
    ada = opened.join(name='Ada')
    opened.tell(ada, event(), event('hand', 1, up=True))
    assert opened.post('leave', {}, ada) == (200, {})
    assert opened.csv()[1:] == opened.view()['hands'] == []
    assert opened.post('events', {'events': [event()]}, ada)[0] == 403


def test_the_csv_is_no_formula(opened):
    ada = opened.join(name='=1+1')
    opened.tell(ada, event(value='=HYPERLINK("http://192.0.2.1")'), event(number=1, value=-1))
    rows = list(csv.reader(opened.csv()))
    assert [row[3] for row in rows[1:]] == ['"=1+1"'] * 2
    assert [row[-1] for row in rows[1:]] == ['"=HYPERLINK(\\"http://192.0.2.1\\")"', '-1']


@given(st.lists(st.integers() | st.floats(allow_nan=False, allow_infinity=False)))
def test_bars_of_numbers_count_each_answer_once_and_are_few(answers):
    shown = bars([answer for answer in answers if abs(answer) <= 2**53])
    assert sum(bar['count'] for bar in shown) == sum(abs(answer) <= 2**53 for answer in answers)
    assert len(shown) <= BARS


@given(
    st.lists(
        st.sampled_from('abcdefghijklmn') | st.booleans() | st.sets(st.integers(0, 2)).map(list)
    )
)
def test_bars_of_other_answers_are_in_the_order_of_their_numbers(answers):
    shown = bars(answers)
    counts = [bar['count'] for bar in shown if bar['label'] != 'other']
    assert counts == sorted(counts, reverse=True)
    assert sum(bar['count'] for bar in shown) == len(answers)
    assert len(shown) <= BARS + 1


def test_letters_and_blanks_make_no_difference():
    assert bars(['A', 'a ', 'B', 1, 1.0]) == [
        {'label': 'A', 'count': 2},
        {'label': '1', 'count': 2},
        {'label': 'B', 'count': 1},
    ]


def test_a_cell_belongs_to_the_step_above_it():
    for known in REAL:
        assert sorted(set(known.step_of.values())) == list(range(len(known.starts)))
        for question, guess in known.guesses.items():
            assert 0 < known.step_of[guess.asked] <= known.step_of[guess.compared], question
            assert guess.asked != guess.compared, question


# --- What is refused -----------------------------------------------------------------------------

FIELDS = ['id', 'kind', 'lesson', 'question', 'value', 'exercise', 'solved', 'cell', 'up', 'seat']
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.sampled_from(FIELDS), inner),
    max_leaves=3,
)
CHANGES = st.tuples(st.sampled_from(FIELDS), JSON).filter(
    lambda change: change[0] != 'value' and change[1] != event().get(change[0])
)
VALUES = st.tuples(
    st.just('value'),
    st.none() | st.dictionaries(st.text(), JSON) | st.lists(st.lists(JSON), min_size=1),
)
BAD_IDS = ['', 'x' * 16, '0' * 15, '0' * 17, '0' * 16 + '\n', 0, None, ['0' * 16]]
BAD_VALUES = ['x' * 201, None, 2**60, -1e300, [[1]], [None], [0] * 21, {'a': 1}]
BAD_VALUES += ['a\u202eb', 'a\nb', '\0']
SCRIPTS = [
    '<script>alert(1)</script>',
    '"><img src=x onerror=alert(1)>',
    "'); DROP TABLE events; --",
]
ATTACKS = [
    *(event() | {'id': bad} for bad in BAD_IDS),
    *(event(value=bad) for bad in BAD_VALUES),
    *(event(question=script) for script in SCRIPTS),
    *(event() | {'kind': kind} for kind in ['', 'seat', None, {}, 'cell', '__class__']),
    *(event() | {extra: 1} for extra in ['seat', 'n', 'at_s', '__proto__', 'name']),
    *({k: v for k, v in event().items() if k != missing} for missing in event()),
    *(event('exercise', exercise=n, solved=True) for n in [-1, 0, 1.5, '1', 2**70, True, None]),
    *(event('exercise', exercise=1, solved=s) for s in [1, 'true', None, []]),
    *(event('hand', up=up) for up in [1, 'yes', None]),
    *(event('cell', cell=cell) for cell in ['', '../..', None, 7, 'x' * 9999]),
    *(event() | {'lesson': name} for name in ['', '../02', None, 2, 'x' * 9999]),
    None,
    1,
    'guess',
    [],
    [event()],
    {},
    True,
]
BODIES = [
    b'',
    b'{', b'null', b'[]', b'1', b'{"events": 1}', b'{"events": [NaN]}', b'\xff\xfe', b'\0' * 99,
    b'{"events": [], "more": 1}', b'[' * 100_000, b'{"events": [' + b'1,' * 60 + b'1]}',
    b'{"events": ["\\ud800"]}', b'{"events": [1' + b'0' * 9999 + b']}', b'--- yaml', b'a=1&b=2',
]  # fmt: skip


def test_attacks_on_the_form_of_an_event(store):
    seat = store.join('ada', '')
    for attack in ATTACKS:
        said = store.take(seat, [attack])
        assert re.fullmatch(r'[A-Z][^.]*\.', said), attack
    assert len(store.as_csv().splitlines()) == 1
    assert store.view(NAME, 1)['guesses'][0]['answered'] == 0


@settings(max_examples=MESSAGES)
@given(JSON | (CHANGES | VALUES).map(lambda change: event() | {change[0]: change[1]}))
def test_what_has_another_form_is_refused_with_a_sentence(one_class_store, message):
    """Anything, or an event with a field that is another one or one too many."""
    assert re.fullmatch(r'[A-Z][^.]*\.', one_class_store.take(1, [message]))
    assert len(one_class_store.as_csv().splitlines()) == 1


def test_attacks_on_the_form_of_a_message(opened):
    ada = opened.join()
    for body in BODIES:
        status, answer = opened.post('events', body, ada)
        assert (status, list(answer)) == (400, ['error']), body
        assert answer['error'].startswith('This is no message to a class: it '), body
        assert opened.post('join', body)[0] == 400
    assert opened.csv()[1:] == []
    assert opened.tell(ada, event()) == ''


def test_a_message_that_is_too_long_is_not_read(opened):
    """The server ends the connection: whether its answer arrives before is a matter of luck."""
    ada = opened.join()
    with contextlib.suppress(urllib.error.URLError, ConnectionError, json.JSONDecodeError):
        status, _ = opened.post('events', b' ' * 300_000, ada)
        assert status == 400
    assert opened.csv()[1:] == []
    assert opened.tell(ada, event()) == ''


@pytest.mark.parametrize('token', ['', 'ada', '0' * 32, "' OR 1=1 --", '../', 'x' * 5000])
def test_a_forged_seat(opened, token):
    opened.tell(opened.join(), event())
    status, answer = opened.post('events', {'events': [event(number=1)]}, token)
    assert (status, answer['error'].startswith('The class that you joined is over.')) == (403, True)
    assert len(opened.csv()) == 2


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
    for path in ('', 'live', 'class.csv', 'class.js'):
        for wrong in (secret[:-1], secret + 'x', secret.upper() + 'A', 'x', opened.code):
            assert refused(f'{own}/{wrong}/{path}') == (404, 'This cannot be answered (404).')
    assert opened.post(f'{secret[:-1]}/end', {})[0] == 404
    for path in ('', 'class.sqlite', secret, f'{secret}/../class.sqlite', f'{secret}/store.py'):
        assert refused(f'{own}/{path}')[0] == 404, path
    page = urllib.request.urlopen(opened.page)
    assert "default-src 'self'" in page.headers['Content-Security-Policy']
    assert page.headers['Cache-Control'] == 'no-store'


@pytest.mark.parametrize('what', ['go', 'show', 'lower', 'nothing'])
@pytest.mark.parametrize('body', [b'', b'{}', b'[]', b'{"step": 99}', b'{"seat": "x"}'])
def test_what_the_page_never_asks(opened, what, body):
    assert opened.post(f'{opened.page.rsplit("/", 2)[1]}/{what}', body)[0] in (400, 404)


def test_a_full_class_and_a_seat_that_told_enough(store):
    for number in range(SEATS):
        seat = store.join(str(number), '')
    with pytest.raises(ValueError, match=r'^The class is full\.$'):
        store.join('one more', '')
    for start in range(0, EVENTS_OF_SEAT, 1000):
        assert store.take(seat, [event(number=start + n) for n in range(1000)]) == ''
    assert store.take(seat, [event(number=EVENTS_OF_SEAT)]) == 'This seat has told enough.'
    assert store.take(seat - 1, [event()]) == ''


# --- Fast, wrong, and too often ------------------------------------------------------------------


def test_a_seat_that_tells_too_much_waits_and_harms_nobody(opened):
    """One seat sends as fast as it can. Another one is heard at once."""
    loud, quiet = opened.join(), opened.join()
    answers = []
    over = threading.Event()

    def shout():
        while not over.is_set():
            number = len(answers)
            body = {'events': [event(number=number, question=OTHER)]}
            answers.append(opened.post('events', body, loud))

    threads = [threading.Thread(target=shout) for _ in range(4)]
    for thread in threads:
        thread.start()
    for number in range(20):
        start = time.monotonic()
        assert opened.tell(quiet, event(number=number, value=number)) == ''
        assert opened.bars()[str(number)] == 1
        print(f'{time.monotonic() - start:.3f} s', len(answers))
    while len(answers) < 2 * EVENTS_AT_ONCE:
        time.sleep(0.01)
    over.set()
    for thread in threads:
        thread.join()
    assert {status for status, _ in answers} == {200, 429}
    assert opened.post('events', {'events': []}, quiet)[0] == 200


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
        command = [sys.executable, '-m', 'tools.class_server', '--root', tmp_path, '--no-browser']
        done = subprocess.run([*command, '--port', str(port)], capture_output=True, text=True)
    assert done.returncode == 1
    said = f'Port {port} cannot be used (Address already in use). Is another class open? '
    assert done.stderr == f'{said}Name another one: make class PORT={port + 1}\n'


def test_a_second_class_here_does_not_begin(tmp_path):
    with running_class(tmp_path) as first:
        second = subprocess.run(
            [sys.executable, '-m', 'tools.class_server', '--root', tmp_path, '--no-browser'],
            env=os.environ | {'JUPYTER_CONFIG_DIR': str(tmp_path / 'jupyter')},
            capture_output=True,
            text=True,
        )
        assert (second.returncode, second.stdout) == (1, '')
        assert second.stderr == 'A class is open here already: Ctrl+C in its terminal ends it.\n'
        assert first.tell(first.join(), event()) == ''


def test_a_class_that_goes_on_with_changed_lessons(store):
    seat = store.join('ada', '')
    cell = event('cell', cell=STEP)
    assert store.take(seat, [event(number=1, value=3), cell]) == ''
    store.close()
    again = Class(store.file, REAL[:1])
    assert again.went_on
    assert Room(again).view()['seats'] == 1
    again.close()


def test_who_can_reach_it(opened, tmp_path):
    """The wall has the address of this machine in its network: others may come and go."""
    assert 'Only this machine can join. LAN=yes lets' in opened.said
    if not in_networks():
        pytest.skip('This machine is in no network.')
    with running_class(tmp_path, '--lan') as wide:
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


# --- Its command --------------------------------------------------------------------------------


def test_a_certificate_that_is_not_there(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv('JUPYTER_CONFIG_DIR', str(tmp_path))
    with pytest.raises(SystemExit):
        main(['--no-browser', '--ssl-cert', str(tmp_path / 'class.cert')])
    assert '--ssl-cert and --ssl-key must both name a file.' in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


# --- A network that is cut -----------------------------------------------------------------------

HELD = """
import sys
from tools.class_server.__main__ import main
main(['--lan', '--no-browser', '--port', '8765', '--root', sys.argv[1]])
"""
TELLS = """
import sys, time
from helpers.classroom import *
join_class(*sys.argv[1:3])
for value in range(60):
    guess(sys.argv[3], value)
    print(value, flush=True)
    time.sleep(float(sys.argv[4]))
sys.stdin.read()
"""
READS = """
import sys, urllib.request
print(urllib.request.urlopen(sys.argv[1] + 'class.csv').read().decode().strip())
"""


def test_what_is_told_while_the_network_is_cut_arrives_once(tmp_path):
    """Nothing says that the network is cut: packets are lost, as in a room without reception."""
    write_lesson(tmp_path)
    with two_machines() as (one, two), contextlib.ExitStack() as stack:
        held = one.start(HELD, tmp_path, JUPYTER_CONFIG_DIR=str(tmp_path / 'jupyter'))
        stack.enter_context(ended(held))
        said = ''
        while not (found := re.search(STARTED, said)):
            said += held.stdout.readline()
        address, code, page, _ = found.groups()
        assert address == f'{ADDRESSES[0]}:8765'
        kernel = student(tmp_path / 'ada') | {HUB_VARIABLE: ''}
        ada = two.start(TELLS, address, code, QUESTION, CUT_S / 50, **kernel)
        stack.enter_context(ended(ada))
        printed = [ada.stdout.readline()]
        while printed[-1] != '5\n':
            printed.append(ada.stdout.readline())
        with one.firewall('drop', 'tcp dport 1 accept'):
            while printed[-1] != '55\n':
                printed.append(ada.stdout.readline())
        assert 'The class does not answer. What you tell is kept until it does.\n' in printed
        rows = wait_for(
            lambda: read_in(one, page), lambda rows: rows[-1][-1] == '59', START_LIMIT_S
        )
    assert [int(row[-1]) for row in rows[1:]] == list(range(60))


def read_in(machine, page):
    reader = machine.start(READS, page)
    return list(csv.reader(reader.communicate(timeout=START_LIMIT_S)[0].splitlines()))
