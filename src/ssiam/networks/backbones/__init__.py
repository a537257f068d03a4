"""Backbones: feature extractors of the networks, one architecture per module."""
