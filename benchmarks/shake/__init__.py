"""Trackers under synthetic camera shake: lost targets by stabilization method."""
