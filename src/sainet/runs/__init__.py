"""Run folders, documents, hashes, worker processes and errors."""
