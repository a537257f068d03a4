"""Camera motion against known motion and against other libraries."""
