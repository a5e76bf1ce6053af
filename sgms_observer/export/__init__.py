"""The observer as C source and the stage as FMU, translated from the very kernels that run in Python."""
