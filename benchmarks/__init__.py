"""Measurements for an idle machine: a module an idea, all run by `python -m benchmarks`."""
