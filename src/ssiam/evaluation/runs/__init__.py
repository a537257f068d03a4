"""Runs of trackers over datasets, and the result files they leave."""
