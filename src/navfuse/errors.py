"""Everything navfuse raises on purpose.

::

    NavfuseError
    ├── InputError        a log or table cannot be used: names file, row or column
    ├── ConfigError       a project file or an option is wrong: names the key
    ├── AlignmentError    no start could be found from the data
    ├── FilterError       the estimator cannot go on: gap, divergence, frame not valid here
    └── OutputError       a result cannot be written

The command line turns any :class:`NavfuseError` into one message and exit code 1; anything else is a defect of navfuse.
:class:`NavfuseWarning` is the category of every warning navfuse emits; the messages are also kept in the
result that they concern.
"""


class NavfuseError(Exception):
    """Base of all errors that navfuse raises on purpose."""


class InputError(NavfuseError, ValueError):
    """A log or table cannot be used; the message names the file and the row or column, and what to do."""


class ConfigError(NavfuseError, ValueError):
    """A project file, setting or option is wrong; the message names the key and what to do."""


class AlignmentError(NavfuseError):
    """No start (position, velocity, attitude) could be found from the data."""


class FilterError(NavfuseError):
    """The estimator cannot go on: an inertial gap, a divergence, or a frame that is not valid here."""


class OutputError(NavfuseError, OSError):
    """A result cannot be written."""


class NavfuseWarning(UserWarning):
    """Category of every warning that navfuse emits."""
