"""Interfaces to the official VOT toolkit: workspaces, and a TraX server for the trackers."""
