"""Recordings prepared for offline work: even pieces, encoder step and noise, band."""
