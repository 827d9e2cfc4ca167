"""The errors of posed: one root, one member for each thing a caller can do something about."""


class PosedError(Exception):
    """Root of every error posed raises on purpose; the message names the thing, the value and the remedy."""


class InvalidArgumentError(PosedError):
    """A value given by the caller is outside what is allowed."""


class InvalidStateError(PosedError):
    """The call does not fit the state things are in."""


class PermissionDeniedError(PosedError):
    """The client lacks a permission that the call needs."""


class SourceLostError(PosedError):
    """What gives the samples is gone: a phone's connection broke, a driver ended. It may come back."""


class ProfileError(PosedError):
    """A device profile is malformed."""


class RecordingError(PosedError):
    """A recording is missing, unreadable or malformed."""


class MissingExtraError(PosedError):
    """An optional dependency is needed and not installed."""


class ServiceUnavailableError(PosedError):
    """No daemon answers, or it went away and did not come back in time."""


class AlreadyRunningError(PosedError):
    """Another daemon of this user holds the runtime directory."""


class RuntimeDirectoryError(PosedError):
    """The runtime directory or something in it is not safe to use."""


class StaleKernelError(PosedError):
    """The compiled filters were made from other sources than those that lie beside them."""
