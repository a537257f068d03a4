"""Measuring: overlaps, trajectories in the official formats, A/R/EAO, success, comparisons."""
