"""Block F: feedforward of the friction of the future motion, and the output stage that limits it."""
