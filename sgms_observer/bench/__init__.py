"""Timings of the package, beside those of other solvers on the same data; see docs/performance.md."""
