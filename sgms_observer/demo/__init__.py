"""The demonstration: both nodes as processes on the graph, a recording, and what it shows."""
