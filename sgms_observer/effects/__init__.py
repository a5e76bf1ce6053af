"""The catalogue of effects: forces and disturbances of a stage beside its friction, each written once."""
