"""A cell that misses a name: what the kernel says below the error."""

import pytest
from support.kernel import Kernel

from helpers.checks.missing_names import NO_ANSWER, NO_GUESS, NOT_RUN, OF_A_CLASS
from helpers.checks.missing_names import explain_missing_name as explain
from helpers.notebook import wrap


@pytest.mark.parametrize(
    ('name', 'first_line', 'begun', 'said'),
    [
        ('Listener', "check('hear', Listener)", True, NO_ANSWER.format('Listener')),
        ('Listener', 'print(Listener)', True, ''),
        ('my_guess', 'compare_prediction("How many?", my_guess, 3)', True, NO_GUESS),
        ('check', "check('hear', Listener)", False, NOT_RUN),
        ('my_guess', 'print(my_guess)', False, NOT_RUN),
        ('join_class', 'join_class("127.0.0.1", "a")', True, OF_A_CLASS),
        ('join_class', 'join_class("127.0.0.1", "a")', False, OF_A_CLASS),
        ('', '%%solution 1', False, NOT_RUN),  # a magic has no name
        ('', '%%solution 1', True, ''),
    ],
)
def test_a_sentence_says_what_to_run(name, first_line, begun, said):
    assert explain(name, first_line, begun) == said.format(name)


def test_a_kernel_says_it_before_any_helper_is_imported():
    not_run = '\n'.join(wrap(NOT_RUN))
    with Kernel() as kernel:
        kernel.run('%load_ext helpers.kernel')
        assert OF_A_CLASS.format('join_class') in kernel.run('join_class("127.0.0.1", "a")')
        assert not_run in kernel.run('print(something)')
        assert not_run in kernel.run('%%solution 1')  # after helpers.checks was loaded
        assert kernel.run('import helpers.workspace') == ''
        said = kernel.run('print(something)')
        assert "name 'something' is not defined" in said
        assert not_run not in said
