"""Parameters from recordings, with intervals, and the references that show them."""
