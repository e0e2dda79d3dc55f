"""The Python interface: short names over the layers below, for scripts."""
