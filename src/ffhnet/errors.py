"""The errors that a user can cause, each saying what was wanted and what came.

The command line prints the message as one line and leaves with exit status 2.
"""


class FFHNetError(Exception):
    """Base of every error that bad input can raise."""


class InputFileError(FFHNetError):
    """A file is missing, truncated, of an unknown type, or not what its name says."""


class CloudError(FFHNetError):
    """A point cloud is empty, too small, not finite, or not in metres."""


class SceneError(FFHNetError):
    """A scene holds no table plane or no object where one was wanted."""


class HandError(FFHNetError):
    """A hand is unknown, or its description or joint names do not fit."""


class ObjectError(FFHNetError):
    """An object or mesh cannot be used: broken, not closed, wrong unit, not stable."""


class WeightsError(FFHNetError):
    """A checkpoint is missing, damaged, or belongs to another hand or architecture."""


class DatasetError(FFHNetError):
    """A data set is missing, damaged, or does not hold what was asked for."""


class OptionError(FFHNetError):
    """An option's value, or a combination of options, cannot be used."""


class MissingExtraError(FFHNetError):
    """An optional dependency is needed; the message names the extra to install."""


class MessageError(FFHNetError):
    """A message of another program contradicts itself, or is of a kind that cannot be read."""
