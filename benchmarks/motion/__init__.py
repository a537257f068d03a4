"""Camera motion: accuracy against known motion, and comparison with other libraries."""
