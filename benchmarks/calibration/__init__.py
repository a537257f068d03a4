"""Measurements that produce constants in src; README.md lists which script produces which."""
