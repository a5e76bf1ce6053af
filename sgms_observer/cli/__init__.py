"""The command line ``sgms``: one module for each command, found by ``main``."""
