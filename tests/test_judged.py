"""What tests know of an answer: it is right, wrong, or nothing has judged it."""

import pytest
from support.kernel import Kernel

NOT_TAKEN = 'The last cell that defines f ended with an error. Mend it and run it, then this one.'


@pytest.mark.parametrize(
    ('verdicts', 'has_error', 'judged'),
    [
        ([{'solved': True}], False, 'right'),
        ([{'solved': False}], False, 'wrong'),
        ([{'solved': False, 'note': NOT_TAKEN}], False, 'wrong'),
        ([{'solved': False, 'note': 'This task needs task 1.'}], False, 'not judged'),
        ([{'solved': False, 'note': 'Your code has changed what judges it.'}], False, 'not judged'),
        ([], True, 'wrong'),
        ([], False, 'not judged'),
    ],
)
def test_only_what_was_judged_is_right_or_wrong(verdicts, has_error, judged):
    kernel = Kernel()
    kernel.verdicts, kernel._has_error = verdicts, has_error
    assert kernel.judged == judged
