"""Reports: one self-contained page, readable offline, on a phone and on paper."""
