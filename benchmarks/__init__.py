"""Measurements for an idle machine, run by `python -m benchmarks`."""
