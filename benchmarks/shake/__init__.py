"""Trackers under synthetic camera shake."""
