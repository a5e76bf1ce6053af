"""The numerical study of Boegli et al. run again, and what this package reaches on the same signals.

This is a shell like the command line: it may use the simulated stage, which the observer itself never sees.
"""
