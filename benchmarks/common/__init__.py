"""Shared by all benchmarks: test data, loading of trackers, tables."""
