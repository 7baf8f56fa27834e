"""The one exception that a user's input can raise."""


class InputError(ValueError):
    """Input from outside (file, option, argument) that cannot be used.

    The message is one sentence that names the file, the field and what was expected; the command line
    prints it as it is and exits with status 2.
    """
