"""Metrics and the paper's tests, each a function of arrays."""
