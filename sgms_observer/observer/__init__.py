"""One axis observed: streams paired by their stamps, samples in, estimates out, the same live and in replay."""
