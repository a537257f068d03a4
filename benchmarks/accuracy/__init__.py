"""Accuracy of the trackers on real sequences."""
