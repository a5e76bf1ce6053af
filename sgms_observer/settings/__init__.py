"""Checked settings: the same YAML for the nodes and for the command line."""
