"""Tests of what a command waits for before it prints."""

import time

import pytest
from nodes import nodes
from rclpy.node import Node

from ros2_command.discovery import wait_until_quiet
from ros2_command.graph import graph

LATE_S = 1.5  # longer than a graph that is quiet is looked at


class HardOfHearing:
    """A node that hears late of the readers, or of the writers, of the others."""

    def __init__(self, node, kind):
        self._node, self._getter = node, f'get_{kind}_info_by_topic'
        self._hears_at_s = time.monotonic() + LATE_S

    @property
    def hears(self):
        return time.monotonic() >= self._hears_at_s

    def __getattr__(self, name):
        if name == self._getter and not self.hears:
            return lambda *args, **kwargs: []
        return getattr(self._node, name)


@pytest.mark.parametrize('kind', ['subscriptions', 'publishers'])
def test_a_command_waits_for_the_other_end_of_each_service(own_domain, kind):
    with nodes() as opened:
        opened.add(Node('talker'))  # it has services for its parameters
        with graph() as command:
            node = HardOfHearing(command.node, kind)
            wait_until_quiet(node)
            assert node.hears
