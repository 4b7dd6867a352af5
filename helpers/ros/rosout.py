"""The log of a session: what its nodes say on `/rosout`."""

from __future__ import annotations

from dataclasses import dataclass

from rcl_interfaces.msg import Log
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile


@dataclass
class Record:
    level: str
    node: str
    text: str
    printed: bool = False

    def print(self) -> None:
        """Print the record as a console would, without its time."""
        self.printed = True
        print(f'[{self.level}] [{self.node}]: {self.text}')


class Rosout:
    """The records of all nodes of a domain, from now on. `node` is the log's own."""

    def __init__(self, node: Node) -> None:
        self.node = node  # or it would be collected, outside of the turn of this process
        self._records: list[Record] = []
        self._subscription = node.create_subscription(
            Log,
            '/rosout',
            lambda record: None,  # never spun: the log takes the records itself
            QoSProfile(depth=100_000, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        # The first log call of a process looks at every imported module, for 0.1 s: not in a
        # callback that is being measured.
        node.get_logger().info('The session is open.')

    def take(self) -> list[Record]:
        """Return the records so far, oldest first."""
        if self._subscription is not None:
            handle = self._subscription.handle
            with handle:
                while (taken := handle.take_message(Log, False)) is not None:
                    message = taken[0]
                    level = LoggingSeverity(message.level).name
                    self._records.append(Record(level, message.name, message.msg))
        return self._records

    def close(self) -> None:
        """Take what is left, before the node is destroyed."""
        self.take()
        self._subscription = None

    def print(self, node: str | None = None) -> None:
        """Print the records so far, oldest first, of one node or of all."""
        for record in self.take():
            if node in (None, record.node):
                record.print()

    def print_warnings(self) -> None:
        """Print the warnings and errors that were not printed yet, by node."""
        # By node, because the executor's order of nodes is chance.
        for record in sorted(self._records, key=lambda record: record.node):
            if record.level in ('WARN', 'ERROR', 'FATAL') and not record.printed:
                record.print()
