"""The benchmark runs. Only an idle machine gives good numbers."""

import pytest

from benchmarks import __main__ as benchmarks
from benchmarks.latency import KINDS, latency_s


@pytest.mark.parametrize('kind', KINDS)
def test_the_latency_of_a_run_is_measured(kind):
    assert 1e-6 < latency_s(kind, 20) < 1


def test_the_table_has_medians_and_ratios():
    found = {'a script': [2e-4, 1e-4, 4e-4], 'a session': [3e-4]}
    lines = benchmarks.table(20, found).to_string(index=False, header=False).splitlines()
    assert [' '.join(line.split()) for line in lines] == [
        '20 Hz a script 200 (100 to 400) 1.00',
        '20 Hz a session 300 (300 to 300) 1.50',
    ]
