"""Measurements that produce constants in src; README.md lists the constants of each script."""
