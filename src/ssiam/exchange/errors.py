"""What goes wrong with results that are to be exchanged."""

from __future__ import annotations

from ssiam.errors import SsiamError


class AnnotationsError(SsiamError):
    """Results that cannot be read as annotations; names the file and, where known, the line."""
