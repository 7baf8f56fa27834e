"""Studies: many seeded runs over a table of settings, on Dask, and what papers say beside what comes out."""
