"""A lifecycle whose steps may fail: a camera, its device, and its state after some steps."""

from __future__ import annotations

from functools import partial

from lifecycle_msgs.srv import GetState
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node

from helpers.ros import ros_session, spin_each

LIMIT_S = 10.0  # for an answer of the node


class Device:
    """A camera without hardware. The calls in `broken` raise an OSError."""

    def __init__(self, *broken: str) -> None:
        self.broken, self.calls = broken, []

    def _call(self, name):
        self.calls.append(name)
        if name in self.broken:
            raise OSError(f'{name}: no camera')

    def __getattr__(self, name):
        if name in ('open', 'start', 'close'):
            return partial(self._call, name)
        raise AttributeError(name)


def state_after(
    camera_class: type[Node], device: Device, *steps: str
) -> tuple[str, str, list[str]]:
    """Trigger steps of a new camera, as long as they succeed.

    Return its state, the result of the last step, and what it has logged as an error. What a step
    raises, and is no OSError of the device, is raised here: rclpy tells nobody. Raises TimeoutError
    if the camera does not say in which state it is.
    """
    raised: list[Exception] = []
    with ros_session() as session:
        tester, camera = Node('tester'), _watched(camera_class, raised)(device)
        results = []
        for step in steps:
            if not results or results[-1] == TransitionCallbackReturn.SUCCESS:
                results.append(getattr(camera, f'trigger_{step}')())
        spin_each(session, camera, tester)
        client = tester.create_client(GetState, '/camera/get_state')
        session.wait_until(client.service_is_ready, LIMIT_S)
        answer = client.call_async(GetState.Request())
        session.wait_until(answer.done, LIMIT_S)
        errors = [
            record.text
            for record in session.records()
            if (record.node, record.level) == ('camera', 'ERROR')
        ]
    if raised:
        raise raised[0]
    return answer.result().current_state.label, results[-1].name, errors


def _watched(camera_class: type[Node], raised: list[Exception]) -> type[Node]:
    def watched(name):
        method = getattr(camera_class, name)

        def step(self, state):
            try:
                result = method(self, state)
                if not isinstance(result, TransitionCallbackReturn):
                    raise TypeError(f'{name} returned {result}. Is there a return?')
                return result
            except OSError:
                raise
            except Exception as error:
                raised.append(error)
                raise

        return step

    names = 'on_configure', 'on_activate', 'on_error'
    return type('Camera', (camera_class,), {name: watched(name) for name in names})
