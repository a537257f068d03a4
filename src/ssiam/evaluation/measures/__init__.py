"""Measures of tracking results: overlap, success, A, R and EAO, paired comparison."""
