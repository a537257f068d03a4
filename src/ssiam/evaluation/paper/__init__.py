"""The paper's experiments: presets of runs, tables and figures, and the page that shows them."""
