"""Detection of lost targets, re-detection, and frames without content."""
