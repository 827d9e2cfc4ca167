"""The version of posed, read by the build and by whoever reports it."""

__version__ = "0.1.0"
