"""Ask a kernel whose cell hangs, in a subshell: a thread that ipykernel 7 begins on demand."""

from __future__ import annotations

import ast

from jupyter_client import BlockingKernelClient, find_connection_file

from .sentences import NOTHING

TIMEOUT_S = 20.0
ASK = "__import__('helpers.waits', fromlist=['waits']).explain()"


def ask_kernel(connection_file: str | None = None) -> str:
    """Return what waits in a kernel: in the one that was used last, if no file names another.

    Raises OSError if there is no kernel, RuntimeError if it does not answer.
    """
    client = BlockingKernelClient(connection_file=connection_file or find_connection_file())
    client.load_connection_file()
    client.start_channels()
    try:
        made = _request(client, client.control_channel, 'create_subshell_request', {}, None)
        name = made['subshell_id']
        content = {
            'code': '',
            'silent': True,
            'store_history': False,
            'user_expressions': {'said': ASK},
            'allow_stdin': False,
        }
        answer = _request(client, client.shell_channel, 'execute_request', content, name)
        _request(client, client.control_channel, 'delete_subshell_request', made, None)
    finally:
        client.stop_channels()
    said = answer['user_expressions']['said']
    if said['status'] != 'ok':
        raise RuntimeError(f'The kernel does not say it: {said["ename"]}: {said["evalue"]}')
    return ast.literal_eval(said['data']['text/plain']) or NOTHING


def _request(client, channel, kind: str, content: dict, subshell: str | None) -> dict:
    message = client.session.msg(kind, content)
    message['header']['subshell_id'] = subshell
    channel.send(message)
    while True:
        answer = channel.get_msg(timeout=TIMEOUT_S)
        if answer['parent_header'].get('msg_id') == message['header']['msg_id']:
            return answer['content']
