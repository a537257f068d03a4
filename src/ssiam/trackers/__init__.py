"""The trackers, and the steadied one that carries them."""

from ssiam.trackers.track import Track

__all__ = ["Track"]
