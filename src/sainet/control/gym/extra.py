"""Gymnasium, or the message that it is missing."""

from sainet.runs.errors import MissingExtra

__all__ = ["gymnasium"]

try:
    import gymnasium
except ImportError:
    raise MissingExtra(
        "The environments need Gymnasium: pip install 'sainet[gym]'."
    ) from None
