"""What does a record cost, and a table of records?

A publisher and a subscription that do nothing, so that only the recorder is measured.
"""

from types import SimpleNamespace

from std_msgs.msg import String

from benchmarks.table import Row, growth, seconds
from helpers.recording import Recording

SIZES = (1_000, 10_000, 100_000)
ROUNDS = 7


def record(messages: list, recorded: bool) -> Recording | None:
    """Publish messages into nothing, and call the callback for each."""
    publisher = SimpleNamespace(publish=lambda message: None)
    subscription = SimpleNamespace(callback=lambda message: None)
    recording = Recording(publisher, subscription) if recorded else None
    for message in messages:
        publisher.publish(message)
        subscription.callback(message)
    return recording


def measure() -> list[Row]:
    """Return the cost of a record for each size, and that of a table."""
    costs, tables = {}, {}
    for size in SIZES:
        messages = [String(data=f'Hello World: {number}') for number in range(size)]
        with_recorder = seconds(lambda messages=messages: record(messages, True), ROUNDS)
        without = seconds(lambda messages=messages: record(messages, False), ROUNDS)
        costs[size] = [(a - b) / size for a, b in zip(with_recorder, without, strict=True)]
        recording = record(messages, True)
        tables[size] = seconds(recording.table, ROUNDS)
    return growth('one of {} records', costs) + growth('table of {} records', tables)
