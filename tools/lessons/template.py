"""What the tasks of this lesson are judged by."""

from std_msgs.msg import Int32

from helpers.checks.bench import Bench
from helpers.checks.points import expect
from helpers.checks.tasks import Tasks

tasks = Tasks()
check = tasks.check


@tasks.add
def hear_the_numbers(Listener):
    def keeps(*numbers):
        with Bench() as bench:
            listener = bench.spin(Listener())
            bench.say('number', *(Int32(data=number) for number in numbers))
        return expect(listener.heard, [*numbers], f'of {[*numbers]} it kept')

    hint = 'A list has .append(...), and an Int32 has .data.'
    return [
        ('it keeps two numbers in order', lambda: keeps(3, 1), hint),
        ('it keeps one number', lambda: keeps(7), hint),
    ]
