"""Detection of lost targets and re-detection."""
