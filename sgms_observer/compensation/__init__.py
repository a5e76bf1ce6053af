"""Block F: the friction of the motion to come as a feedforward, and the last stage that keeps it safe."""
