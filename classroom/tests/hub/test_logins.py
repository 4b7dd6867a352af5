"""Students log in with a university or from Moodle: hub/values-oidc.yaml and values-lti.yaml.

A real JupyterHub has the settings of these files, and asks a provider of this machine. Only
addresses, the client id and the secret are others.
"""

import asyncio
import re
import tempfile
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import requests
from cryptography.hazmat.primitives.asymmetric import rsa
from oidc_provider_mock import User, run_server_in_thread

from classroom.tests.support.hubs import Hub, free_ports, needs_hub
from classroom.tests.support.logins import (
    HUB_URL,
    Moodle,
    ask,
    config_of,
    name_in,
    open_home,
    read_sample,
)

pytestmark = needs_hub
# Each hub has a setting that does not exist, too: JupyterHub must warn of that one and no other.
MISTAKE = 'no_such_setting'


def wait_for_answer(coroutine: Coroutine) -> object:
    """Wait in another thread, for Playwright has an event loop in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, coroutine).result()


def start_hub(sample: str, port: int, **more: dict):
    """Yield a hub with the settings of a sample, for a fixture."""
    short = tempfile.TemporaryDirectory(prefix='hub-', dir='/tmp', ignore_cleanup_errors=True)
    with short as folder, Hub(Path(folder), config_of(sample, **more), port=port) as hub:
        wait_for_answer(hub.until_ready())
        yield hub


def unknown_settings(hub: Hub) -> list[str]:
    return re.findall(r'Config option `(\w+)` not recognized', hub.log.read_text())


def account(hub: Hub, name: str) -> dict:
    return wait_for_answer(hub.ask(f'/hub/api/users/{name}'))


# --- A university, by OpenID Connect --------------------------------------------------------------

# By what the university calls them inside, and never shows.
ACCOUNTS = {
    'u1': {'preferred_username': 'ada', 'groups': ['COURSE', 'CHESS'], 'email': 'a@example.org'},
    'u2': {'preferred_username': 'bob', 'groups': ['CHESS']},
    'u3': {'preferred_username': 'cy'},
    'u4': {'preferred_username': 'TEACHER'},
    'u5': {'preferred_username': 'eve', 'groups': ['COURSE']},
    'u6': {'groups': ['COURSE']},
}


@pytest.fixture(scope='module')
def university():
    """Yield the address of a provider of OpenID Connect."""
    users = [User(sub=sub, claims=claims) for sub, claims in ACCOUNTS.items()]
    with run_server_in_thread(require_client_registration=True, user_claims=users) as server:
        yield f'http://localhost:{server.server_port}'


@pytest.fixture(scope='module')
def hub_of_university(university):
    """Yield a hub that is registered there, as values-oidc.yaml says."""
    [port] = free_ports(1)
    url = f'http://127.0.0.1:{port}'
    client = requests.post(
        f'{university}/oauth2/clients',
        json={
            'redirect_uris': [f'{url}/hub/oauth_callback'],
            'token_endpoint_auth_method': 'client_secret_post',
        },
    ).json()
    known = requests.get(f'{university}/.well-known/openid-configuration').json()
    addresses = {
        HUB_URL: url,
        'https://LOGIN.EXAMPLE.ORG/authorize': known['authorization_endpoint'],
        'https://LOGIN.EXAMPLE.ORG/token': known['token_endpoint'],
        'https://LOGIN.EXAMPLE.ORG/userinfo': known['userinfo_endpoint'],
        'CLIENT_ID': client['client_id'],
    }
    settings = {'client_secret': client['client_secret'], MISTAKE: 1}
    sample = read_sample('values-oidc.yaml', addresses)
    yield from start_hub(sample, port, GenericOAuthenticator=settings)


def log_in(hub: Hub, sub: str) -> tuple[requests.Session, requests.Response]:
    """Log in at the university. Return the browser, and the page that comes last."""
    browser = requests.Session()
    form = browser.get(f'{hub.url}/hub/oauth_login?next=/hub/home')
    return browser, browser.post(form.url, {'sub': sub})


def test_a_hub_offers_the_login_of_its_university(hub_of_university):
    page = requests.get(f'{hub_of_university.url}/hub/login').text
    assert 'Sign in with EXAMPLE UNIVERSITY' in page
    assert 'password' not in page


def test_who_is_in_the_course_gets_in_by_name(hub_of_university):
    browser, page = log_in(hub_of_university, 'u1')
    assert page.url == f'{hub_of_university.url}/hub/home'
    assert name_in(open_home(hub_of_university, browser)) == 'ada'
    assert account(hub_of_university, 'ada')['admin'] is False
    assert browser.get(f'{hub_of_university.url}/hub/admin').status_code == 403


@pytest.mark.parametrize('sub', ['u2', 'u3'])
def test_who_is_not_in_the_course_is_refused(hub_of_university, sub):
    browser, page = log_in(hub_of_university, sub)
    assert page.status_code == 403
    assert open_home(hub_of_university, browser) == ''


def test_who_has_no_name_is_refused(hub_of_university):
    browser, page = log_in(hub_of_university, 'u6')
    assert page.status_code >= 400
    assert open_home(hub_of_university, browser) == ''


def test_who_has_left_the_course_is_refused_the_next_time(hub_of_university, university):
    assert log_in(hub_of_university, 'u5')[1].status_code == 200
    requests.put(f'{university}/users/u5', json=ACCOUNTS['u5'] | {'groups': []}).raise_for_status()
    assert log_in(hub_of_university, 'u5')[1].status_code == 403


def test_the_teacher_of_the_file_is_admin(hub_of_university):
    browser, page = log_in(hub_of_university, 'u4')
    assert page.status_code == 200
    assert account(hub_of_university, 'teacher')['admin'] is True
    assert browser.get(f'{hub_of_university.url}/hub/admin').status_code == 200


def test_a_login_that_another_browser_began_is_refused(hub_of_university):
    browser = requests.Session()
    form = browser.get(f'{hub_of_university.url}/hub/oauth_login')
    back = browser.post(form.url, {'sub': 'u1'}, allow_redirects=False).headers['Location']
    for other in (requests.Session(), log_in(hub_of_university, 'u2')[0]):
        assert other.get(back).status_code == 400
        assert open_home(hub_of_university, other) == ''


def test_the_hub_asks_for_no_more_than_it_needs(hub_of_university):
    form = requests.get(f'{hub_of_university.url}/hub/oauth_login')
    assert 'scope=openid+profile&' in f'{form.url}&'


def test_each_setting_for_a_university_exists(hub_of_university):
    assert unknown_settings(hub_of_university) == [MISTAKE]


# --- Moodle, by LTI 1.3 ---------------------------------------------------------------------------


@pytest.fixture(scope='module')
def moodle():
    with Moodle() as running:
        yield running


@pytest.fixture(scope='module')
def hub_of_moodle(moodle):
    """Yield a hub that is a tool of Moodle, as values-lti.yaml says, also in its comment."""
    [port] = free_ports(1)
    addresses = {HUB_URL: f'http://127.0.0.1:{port}', 'https://MOODLE.EXAMPLE.ORG': moodle.url}
    sample = read_sample('values-lti.yaml', addresses | {'CLIENT_ID': moodle.client_id})
    moodle.tool = dict(re.findall(r'^#  +(.*?)  +(http\S+)$', sample, re.MULTILINE))
    yield from start_hub(sample, port, LTI13Authenticator={MISTAKE: 1})


def launch(moodle: Moodle, user: str) -> tuple[requests.Session, requests.Response]:
    """Open the hub from the course. Return the browser, and the page that comes last."""
    browser = requests.Session()
    asked = ask(browser, moodle, user)
    return browser, browser.post(asked['redirect_uri'], moodle.answer(user, asked))


def test_a_student_of_moodle_gets_in_as_a_number(hub_of_moodle, moodle):
    browser, page = launch(moodle, '7')
    assert (page.status_code, page.url) == (200, f'{hub_of_moodle.url}/hub/home')
    assert name_in(open_home(hub_of_moodle, browser)) == '7'
    assert account(hub_of_moodle, '7')['admin'] is False
    assert browser.get(f'{hub_of_moodle.url}/hub/admin').status_code == 403


def test_no_name_of_a_student_of_moodle_is_kept(hub_of_moodle, moodle):
    launch(moodle, '7')
    for file in (hub_of_moodle.folder / 'hub.sqlite', hub_of_moodle.log):
        assert b'Lovelace' not in file.read_bytes()
        assert b'ada@example.org' not in file.read_bytes()


def test_the_teacher_of_moodle_is_admin(hub_of_moodle, moodle):
    browser, _ = launch(moodle, '2')
    assert account(hub_of_moodle, '2')['admin'] is True
    assert browser.get(f'{hub_of_moodle.url}/hub/admin').status_code == 200


OTHER_KEY = rsa.generate_private_key(public_exponent=65537, key_size=2048)
# What is changed, and what the hub then says.
FORGED = {
    'signed with another key': ({'signed_with': (OTHER_KEY, 'RS256')}, 'Signature verification'),
    'signed with a word': ({'signed_with': ('x' * 32, 'HS256')}, 'alg value is not allowed'),
    'not signed': ({'signed_with': (None, 'none')}, 'alg value is not allowed'),
    'for another tool': ({'aud': 'another'}, 'Audience'),
    'of another Moodle': ({'iss': 'https://moodle.example.org'}, 'issuer'),
    'of yesterday': ({'exp': 1}, 'expired'),
    'of another launch': ({'nonce': 'another'}, 'nonce mismatch'),
    'of nobody': ({'sub': ''}, 'Unable to set the username'),
}


@pytest.mark.parametrize('forgery', FORGED)
def test_a_forged_launch_is_refused(hub_of_moodle, moodle, forgery):
    changed, said = FORGED[forgery]
    browser = requests.Session()
    asked = ask(browser, moodle, '7')
    token = moodle.token('7', **{'nonce': asked['nonce'], **changed})
    answer = browser.post(asked['redirect_uri'], {'id_token': token, 'state': asked['state']})
    assert answer.status_code in (400, 401)
    assert said in answer.text
    assert open_home(hub_of_moodle, browser) == ''


def test_a_launch_counts_once_and_in_its_own_browser(hub_of_moodle, moodle):
    browser = requests.Session()
    asked = ask(browser, moodle, '7')
    fields = moodle.answer('7', asked)
    thief = requests.Session()
    own = ask(thief, moodle, '8')['state']
    for state in (fields['state'], own):  # it is not the thief's, or its token is not
        assert thief.post(asked['redirect_uri'], fields | {'state': state}).status_code == 400
    assert requests.post(asked['redirect_uri'], fields).status_code == 400
    assert open_home(hub_of_moodle, thief) == ''

    assert browser.post(asked['redirect_uri'], fields).status_code == 200
    assert browser.post(asked['redirect_uri'], fields).status_code == 400


def test_each_setting_for_moodle_exists(hub_of_moodle):
    assert unknown_settings(hub_of_moodle) == [MISTAKE]


def test_chromium_opens_the_hub_in_a_window_and_in_no_frame(hub_of_moodle, moodle, chromium):
    """Moodle and the hub are two sites here, so the rules for cookies of other sites count."""
    with chromium.new_context() as context:
        tab = context.new_page()
        tab.goto(f'{moodle.url}/course/9')
        tab.wait_for_url(f'{hub_of_moodle.url}/hub/home')
        assert name_in(tab.content()) == '9'
    with chromium.new_context() as context:
        tab = context.new_page()
        tab.goto(f'{moodle.url}/mod/lti/certs.php')
        with tab.expect_response(moodle.tool['redirection URI']) as refused:
            tab.set_content(f'<iframe src="{moodle.url}/course/9"></iframe>')
        assert refused.value.status == 400
        assert "frame-ancestors 'none'" in refused.value.headers['content-security-policy']
