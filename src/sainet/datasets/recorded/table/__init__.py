"""Anybody's own pushes: a table from CSV or Parquet, checked row by row."""
