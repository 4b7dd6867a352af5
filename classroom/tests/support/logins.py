"""A Moodle of this machine, from which students log in, and the hub with the settings of a sample.

Moodle does what its mod/lti does when a student opens a tool: it tells the tool to begin
(locallib.php), checks what the tool then asks (auth.php), and signs who the student is, with a key
whose public half anybody may read (certs.php).
"""

import json
import re
import threading
import time
from html import escape
from urllib.parse import parse_qsl, urlsplit

import jwt
import requests
import yaml
from cryptography.hazmat.primitives.asymmetric import rsa
from flask import Flask, abort, jsonify, request
from werkzeug.serving import make_server

from classroom.tests.support.hubs import ROOT, Hub

VALUES = ROOT / 'classroom/hub'
HUB_URL = 'https://CLASS.EXAMPLE.ORG'  # in the samples
CLAIM = 'https://purl.imsglobal.org/spec/lti/claim/'
ROLE = 'http://purl.imsglobal.org/vocab/lis/v2/membership#Learner'
# As the chart does with `hub.config`. No server starts: the login is what is tried.
CONFIG = """
import json
for section, settings in json.loads({settings!r}).items():
    c[section].update(settings)
c.JupyterHub.spawner_class = 'simple'
c.JupyterHub.redirect_to_server = False
"""


def read_sample(name: str, addresses: dict[str, str]) -> str:
    """Return a file of values, with addresses and names of this machine for those in capitals."""
    text = (VALUES / name).read_text()
    for sample, ours in addresses.items():
        assert sample in text, f'{name} has no {sample}'
        text = text.replace(sample, ours)
    return text


def config_of(sample: str, **more: dict) -> str:
    """Return the configuration of `--values values.yaml --values SAMPLE --set hub.config...`."""
    merged = {}
    for part in (yaml.safe_load((VALUES / 'values.yaml').read_text()), yaml.safe_load(sample)):
        for section, settings in part['hub']['config'].items():
            merged.setdefault(section, {}).update(settings)
    for section, settings in more.items():
        merged[section].update(settings)
    return CONFIG.format(settings=json.dumps(merged))


def open_home(hub: Hub, browser: requests.Session) -> str:
    """Return the page that a hub shows to somebody who has logged in, or nothing."""
    page = browser.get(f'{hub.url}/hub/home', allow_redirects=False)
    return page.text if page.status_code == 200 else ''


def name_in(home: str) -> str:
    """Return the name that a hub gives to the person who opened its page, or nothing."""
    found = re.search(r'user: "(.*?)"', home)
    return found[1] if found else ''


class Moodle:
    """The part of a Moodle that opens a tool by LTI 1.3. It runs in its `with` block.

    `tool` is what the administrator of Moodle has written about the tool, by the names of Moodle.
    """

    client_id = 'x7Yz1Qw9'

    def __init__(self) -> None:
        self.tool: dict[str, str] = {}
        self.key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
        app = Flask('moodle')
        app.add_url_rule('/course/<user>', view_func=self._course)
        app.add_url_rule('/mod/lti/auth.php', view_func=self._authorize)
        app.add_url_rule('/mod/lti/certs.php', view_func=self._keys)
        # By this name a browser takes it for another site than the hub, at 127.0.0.1.
        self._server = make_server('localhost', 0, app, threaded=True)
        self.url = f'http://localhost:{self._server.server_port}'

    def __enter__(self) -> 'Moodle':
        threading.Thread(target=self._server.serve_forever).start()
        return self

    def __exit__(self, *_) -> None:
        self._server.shutdown()
        self._server.server_close()

    def begin(self, user: str) -> dict[str, str]:
        """Return what a click of a student on the tool sends to it."""
        return {
            'iss': self.url,
            'target_link_uri': self.tool['tool URL'],
            'login_hint': user,
            'lti_message_hint': '{"cmid": 5}',
            'client_id': self.client_id,
            'lti_deployment_id': '1',
        }

    def answer(self, user: str, asked: dict[str, str]) -> dict[str, str]:
        """Return what a tool gets that asks who somebody is, or answer 400 if it may not ask."""
        wanted = {
            'scope': 'openid',
            'response_type': 'id_token',
            'response_mode': 'form_post',
            'prompt': 'none',
            'client_id': self.client_id,
            'login_hint': user,
            'redirect_uri': self.tool['redirection URI'],
        }
        wrong = [name for name, value in wanted.items() if asked.get(name) != value]
        if wrong or not asked.get('nonce'):
            abort(400, f'{wrong or "nonce"}: {asked}')
        return {'id_token': self.token(user, asked['nonce']), 'state': asked['state']}

    def token(self, user: str, nonce: str, signed_with: tuple = (), **changed: object) -> str:
        """Return who a student is, with a name that no hub need keep. It is signed with a key."""
        key, method = signed_with or (self.key, 'RS256')
        claims = {
            'iss': self.url,
            'aud': self.client_id,
            'sub': user,
            'nonce': nonce,
            'iat': int(time.time()),
            'exp': int(time.time()) + 60,
            'name': 'Ada Lovelace',
            'email': 'ada@example.org',
            f'{CLAIM}version': '1.3.0',
            f'{CLAIM}message_type': 'LtiResourceLinkRequest',
            f'{CLAIM}deployment_id': '1',
            f'{CLAIM}target_link_uri': self.tool['tool URL'],
            f'{CLAIM}roles': [ROLE],
            f'{CLAIM}resource_link': {'id': '5', 'title': 'Lessons'},
            f'{CLAIM}context': {'id': '3', 'label': 'ROS2', 'type': ['CourseSection']},
        }
        return jwt.encode(claims | changed, key, method, headers={'kid': 'ours'})

    def _course(self, user: str):
        page = _form(self.tool['initiate login URL'], self.begin(user))
        return page, {'Set-Cookie': f'user={user}; Path=/'}

    def _authorize(self):
        fields = self.answer(request.cookies.get('user', ''), request.args)
        return _form(request.args['redirect_uri'], fields)

    def _keys(self):
        key = jwt.algorithms.RSAAlgorithm.to_jwk(self.key.public_key(), as_dict=True)
        return jsonify(keys=[key | {'kid': 'ours', 'alg': 'RS256', 'use': 'sig'}])


def _form(address: str, fields: dict[str, str]) -> str:
    """Return a page that sends a form at once, as those of Moodle do."""
    inputs = [f'<input name="{name}" value="{escape(text)}">' for name, text in fields.items()]
    form = f'<form method="post" action="{address}">{"".join(inputs)}</form>'
    return f'<!doctype html>{form}<script>document.forms[0].submit()</script>'


def ask(browser: requests.Session, moodle: Moodle, user: str) -> dict[str, str]:
    """Click on the tool. Return what the hub then asks Moodle."""
    begun = browser.post(
        moodle.tool['initiate login URL'], moodle.begin(user), allow_redirects=False
    )
    assert begun.headers['Location'].startswith(f'{moodle.url}/mod/lti/auth.php?')
    return dict(parse_qsl(urlsplit(begun.headers['Location']).query))
