"""Lets a trouble begin and end: `with happening(trial): ...`."""

from __future__ import annotations

import contextlib
import mmap
import signal
import struct
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import psutil
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.qos import QoSProfile, qos_profile_sensor_data

from ordeal.robot import Second, emptied, spoilt, stamped, voice
from ordeal.troubles import OF_INPUTS, SIGNALS

if TYPE_CHECKING:
    from ordeal.trial import Trial


def happening(trial: Trial) -> contextlib.AbstractContextManager:
    """Return a context in which the trouble of a trial is there."""
    trouble = trial.trouble
    if trouble.what == 'a second node':
        return second_node(trial)
    if trouble.what in OF_INPUTS:
        return changed_input(trial)
    if trouble.what in SIGNALS:
        return signalled(trial)
    if trouble.what == 'raises':
        return raising(trial)
    if 'value' in trouble.values:
        return changed_parameter(trial)
    return {'clock': jumped_clock, 'cmd_vel': second_voice, 'network': cut_network}[trouble.of](
        trial
    )


# --- Inputs


@contextlib.contextmanager
def changed_input(trial: Trial) -> Iterator[None]:
    changes, topic = trial.robot.changes, trial.trouble.of
    changes[topic] = change(trial)
    yield
    del changes[topic]


def change(trial: Trial) -> Callable[[Any], Any]:
    """Return what each message becomes; None: it is not said."""
    said = trial.robot.said.get(trial.trouble.of, [])
    last = said[-1][1] if said else None
    ahead_ns = round(trial.values['ahead_s'] * 1e9)

    def frozen(message: Any) -> Any:
        last.header.stamp = message.header.stamp
        return last

    def old(message: Any) -> Any:
        limit = time.monotonic() - trial.values['age_s']
        earlier = [made for t, made in said if t <= limit]
        return earlier[-1] if earlier else said[0][1]

    def early(message: Any) -> Any:
        stamp = message.header.stamp
        return stamped(message, stamp.sec * 10**9 + stamp.nanosec + ahead_ns)

    return {
        'silent from the start': lambda message: None,
        'silent': lambda message: None,
        'frozen': frozen,
        'NaN': spoilt,
        'empty': emptied,
        'old': old,
        'early stamps': early,
        'stamps of another clock': lambda message: stamped(message, time.monotonic_ns()),
    }[trial.trouble.what]


@contextlib.contextmanager
def second_node(trial: Trial) -> Iterator[None]:
    """Somebody else says again and again what the robot said first, with stamps of now."""
    robot, topic = trial.robot, trial.trouble.of
    sensor = topic == 'scan' and robot.driver.laser == 'ld08'
    qos = qos_profile_sensor_data if sensor else QoSProfile(depth=10)
    trial.second = Second(robot, topic, robot.said[topic][0][1], qos)
    yield
    end_second(trial)


@contextlib.contextmanager
def second_voice(trial: Trial) -> Iterator[None]:
    """Somebody else wants to drive at 0.3 m/s."""
    trial.second = voice(trial.robot, 0.3)
    yield
    end_second(trial)


def end_second(trial: Trial) -> None:
    second, trial.second = trial.second, None
    second.end()


# --- The program itself


@contextlib.contextmanager
def signalled(trial: Trial) -> Iterator[None]:
    process = trial.programs()[trial.trouble.of]
    process.send_signal(signal.Signals[trial.trouble.what])
    yield
    if trial.trouble.what == 'SIGSTOP':
        with contextlib.suppress(psutil.NoSuchProcess):
            process.send_signal(signal.SIGCONT)


@contextlib.contextmanager
def raising(trial: Trial) -> Iterator[None]:
    (trial.folder / f'raise {trial.trouble.of}').touch()
    yield


@contextlib.contextmanager
def changed_parameter(trial: Trial) -> Iterator[None]:
    node, name = trial.trouble.of.split('.', 1)
    answer = trial.call(
        GetParameters, f'{node}/get_parameters', GetParameters.Request(names=[name])
    )

    def change_to(number: float) -> None:
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=number)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])
        trial.call(SetParameters, f'{node}/set_parameters', request)

    change_to(trial.values['value'])
    yield
    if answer is not None:
        change_to(answer.values[0].double_value)


# --- Its computer


@contextlib.contextmanager
def jumped_clock(trial: Trial) -> Iterator[None]:
    def ahead_by(seconds: float) -> None:
        with trial.clock.open('r+b') as file, mmap.mmap(file.fileno(), 8) as page:
            page[:] = struct.pack('q', round(seconds * 1e9))

    ahead_by(trial.values['jump_s'])
    yield
    ahead_by(0.0)


@contextlib.contextmanager
def cut_network(trial: Trial) -> Iterator[None]:
    trial.network.cut()
    yield
    trial.network.mend()
