"""GMS and S-GMS friction: compiled steps with exact derivatives, and the symbolic model they are held to."""
