"""What can go wrong, by where it went wrong. A message names what came, what was expected and what there is."""

from __future__ import annotations


class TrackerError(Exception):
    """Base of every error that this project raises on purpose."""


class FrameError(TrackerError):
    """A frame, a pose or a camera matrix that cannot be right."""


class LateFrameError(FrameError):
    """A frame that is not after the last one. Whoever refused it is as before: leave it out and go on."""


class SourceError(TrackerError):
    """A source of frames that cannot be opened, or a file of it that cannot be read."""


class ModelError(TrackerError):
    """A concept model that is damaged, of another version or of another backend."""


class OnboardingError(TrackerError):
    """Reference frames from which no usable model can be made."""


class ConfigError(TrackerError):
    """A setting that does not exist or whose value is out of range."""


class VocabularyError(TrackerError):
    """A language model that cannot be asked for concepts, or an answer of it that cannot be used."""


class OutputError(TrackerError):
    """A result that cannot be written where it should go, or a result file that cannot be read."""


class MissingExtraError(TrackerError):
    """An optional package is needed; the message has the command that installs it."""


class MissingLibraryError(TrackerError):
    """A library of the operating system is needed; the message has the command that installs it."""
