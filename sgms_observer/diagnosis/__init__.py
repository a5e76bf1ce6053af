"""The diagnosis: where model and recording disagree, which effect is missing, and what it closes."""
