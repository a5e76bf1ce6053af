"""``sgms commission``: from a table that moves to a compensation that is switched on, step by step and resumable."""
