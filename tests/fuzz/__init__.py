"""Damaged inputs for every reader and socket; `make fuzz` runs them for minutes."""
