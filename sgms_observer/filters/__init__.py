"""Block V: filters that give velocity, acceleration and the effort on one and the same delay."""
