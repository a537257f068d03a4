"""Scripts whose results are constants in src."""
