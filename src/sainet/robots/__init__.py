"""Things that observe disks and execute pushes."""
