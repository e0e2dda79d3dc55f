"""Recorded pushes: readers of three formats, one resampler, one writer of stores."""
