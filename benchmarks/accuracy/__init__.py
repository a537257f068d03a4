"""Accuracy of trackers on real sequences."""
