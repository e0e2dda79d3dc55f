"""Tables, figures and the self-contained HTML report: NumPy arrays in, files out."""

WRITERS: tuple[str, ...] = (
    ".md",
    ".html",
    ".tex",
    ".csv",
)  # endings of files of a table
