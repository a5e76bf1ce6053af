"""Freed memory is used again: the system does not clear the same pages for every array."""

import ctypes
import resource
import subprocess
import sys

import pytest

COUNT = """
import resource, sys
import numpy as np
from sgms_observer.freed_memory import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(50):
        columns = [np.ones(500_000) for _ in range(5)]
        del columns
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

first = faults()
keep_freed_memory()
faults()
print(first, faults())
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="only glibc returns memory so eagerly")
def test_pages_are_used_again():
    """Twenty megabytes that are allocated and freed fifty times take new pages once."""
    done = subprocess.run([sys.executable, "-c", COUNT], capture_output=True, text=True, check=True)
    before, after = map(int, done.stdout.split())
    assert after < 20e6 / resource.getpagesize() < before
