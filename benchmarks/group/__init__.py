"""Several targets in one group."""
