"""Any number of studies, on all cores or a cluster, into one Parquet data set (docs/batch.md)."""
