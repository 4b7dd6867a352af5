"""The benchmarks run. Only an idle machine gives good numbers."""

import pytest

from benchmarks import __main__ as benchmarks
from benchmarks.latency import KINDS, latency_s


def test_a_benchmark_compares_sizes():
    assert len(list(benchmarks.model(sizes=(1, 3)))) == 4


@pytest.mark.parametrize('kind', KINDS)
def test_the_latency_of_a_run_is_measured(kind):
    assert 1e-6 < latency_s(kind, 20) < 1


def test_the_table_shows_medians_with_their_spread():
    growth = benchmarks.growth('{} steps', {10: [2e-6], 1000: [1]})
    rows = [benchmarks.Row('a build', [8, 7, 12], 'one', [4.0]), *growth]
    assert [' '.join(line.split()) for line in benchmarks.table(rows).splitlines()[1:]] == [
        'a build 8 s (7 to 12) one: 4 s 2.00',
        '1,000 steps 1 s 10: 2 us 500000.00',
    ]


def test_an_unknown_name_is_refused(capsys):
    with pytest.raises(SystemExit):
        benchmarks.main(['speed'])
    assert 'speed is none of latency, model' in capsys.readouterr().err
