"""Tables, figures and the self-contained HTML report: NumPy arrays in, files out."""
