"""The benchmark runs. Only an idle machine gives good numbers."""

import pytest

from benchmarks.latency import KINDS, latency_s


@pytest.mark.parametrize('kind', KINDS)
def test_the_latency_of_a_run_is_measured(kind):
    assert 1e-6 < latency_s(kind, 20) < 1
