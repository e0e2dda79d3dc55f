"""The project's own engine: disks and a cylindrical pusher on a table, batched."""
