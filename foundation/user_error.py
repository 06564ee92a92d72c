"""The one exception for what a user did wrong."""


class UserError(Exception):
    """A mistake of the user: one line that names the thing, the value, the limit and the place.

    The command line prints the line and leaves with exit code 2; library users may catch it.
    """
