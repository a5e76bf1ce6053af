"""Many recordings at once: in processes of this machine or on a Dask cluster, with one summary page."""
