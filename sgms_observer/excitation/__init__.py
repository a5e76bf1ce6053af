"""References for recordings, designed by the information that they bring about the asked parameters and effects."""
