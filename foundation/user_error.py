"""The one exception for what a user did wrong."""


def printable(text: str) -> str:
    """`text` on one line that a terminal only shows: what is no printable character is written as its escape.

    So neither a file's name nor a line of a foreign file can colour, hide or fake a message.
    """
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode("ascii") for each in text)


class UserError(Exception):
    """A mistake of the user: a line that names the thing, the value, the limit and the place; or several such lines.

    The command line prints them and leaves with exit code 2; library users may catch it. Each line is printable,
    whatever was put into it.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__(*(printable(line) for line in lines))

    def __str__(self) -> str:
        return "\n".join(self.args)
