"""Gymnasium, or the message that it is missing."""

from sainet.runs.errors import missing_extra

__all__ = ["gymnasium"]

try:
    import gymnasium
except ImportError:
    raise missing_extra("The environments need Gymnasium", "gym") from None
