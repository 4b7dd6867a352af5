"""The manager: it configures and activates the lifecycle nodes that its parameters name."""

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from courier.program import run

NEXT = {
    State.PRIMARY_STATE_UNCONFIGURED: Transition.TRANSITION_CONFIGURE,
    State.PRIMARY_STATE_INACTIVE: Transition.TRANSITION_ACTIVATE,
}
LOST = 5  # looks without an answer: it is lost, as it may be while two nodes find each other


class Manager(Node):
    def __init__(self):
        super().__init__('manager')
        names = self.declare_parameter('node_names', ['']).value
        autostart = self.declare_parameter('autostart', False).value
        self.nodes = [Managed(self, name) for name in names if name] if autostart else []
        self.create_timer(0.2, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def look(self):
        for node in self.nodes:
            node.look()

    def stop(self):
        """The nodes end by themselves."""


class Managed:
    """A lifecycle node: ask for its state, and bring it one step on, without waiting."""

    def __init__(self, manager, name):
        self.states = manager.create_client(GetState, f'{name}/get_state')
        self.changes = manager.create_client(ChangeState, f'{name}/change_state')
        self.client, self.asked, self.looks = self.states, None, 0

    def look(self):
        self.looks += 1
        if not self.states.service_is_ready() or not self.changes.service_is_ready():
            self.asked = None  # it is not there, or not any more
        elif self.asked is None or self.asked.done():
            self.ask(self.states, GetState.Request())
            self.asked.add_done_callback(self.on_state)
        elif self.looks > LOST:
            self.client.remove_pending_request(self.asked)
            self.asked = None

    def ask(self, client, request):
        self.client, self.asked, self.looks = client, client.call_async(request), 0

    def on_state(self, future):
        change = NEXT.get(future.result().current_state.id)
        if change is not None:
            self.ask(self.changes, ChangeState.Request(transition=Transition(id=change)))


def main():
    run(Manager)
