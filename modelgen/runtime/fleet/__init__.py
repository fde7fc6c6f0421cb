"""Many records of many machines on dask workers."""
