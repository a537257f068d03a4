"""Evaluation: benchmark runs, result files, measures, the paper's tables, the VOT toolkit.

`measures` computes numbers from results. `runs` runs trackers over datasets; `runs.result_files`
reads and writes the result files. `paper` makes the paper's tables and figures. `vot` connects to
the official VOT toolkit. `reports` is behind ``ssiam eval``, `tuning` behind ``ssiam tune``.
"""
