"""Measurements for an idle machine, run by `make bench`."""
