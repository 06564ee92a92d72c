"""A2ML as the standard ASAP2 has it, as far as needed to hold IF_DATA against it; shares nothing with the generator."""

import re

RANGES = {"uchar": (0, 0xFF), "uint": (0, 0xFFFF), "ulong": (0, 0xFFFFFFFF)}


class Grammar:
    """Reads the text between /begin A2ML and /end A2ML; `check` says what in IF_DATA it does not allow."""

    def __init__(self, text):
        text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
        self.tokens = re.findall(r'"[^"]*"|\w+|\)\*|[^\s\w]', text)
        self.at = 0
        self.named = {}
        self.blocks = {}
        while self.at < len(self.tokens):
            if self.peek() == "block":
                self.take()
                tag = self.take()
                self.blocks[tag.strip('"')] = self.type()
            else:
                self.type()
            self.take(";")

    def peek(self):
        return self.tokens[self.at]

    def take(self, wanted=None):
        token = self.tokens[self.at]
        assert wanted in (None, token), f"A2ML: {token!r} where {wanted!r} is expected"
        self.at += 1
        return token

    def type(self):
        kind = self.take()
        if kind in RANGES:
            return (kind,)
        if kind == "char":
            self.take("[")
            length = int(self.take())
            self.take("]")
            return ("char", length)
        assert kind in ("enum", "struct", "taggedstruct", "taggedunion"), kind
        name = self.take() if re.fullmatch(r"\w+", self.peek()) else None
        if self.peek() != "{":
            return self.named[kind, name]
        self.take("{")
        members = []
        while self.peek() != "}":
            members.append(self.enumerator() if kind == "enum" else self.member(kind))
        self.take("}")
        made = (kind, members)
        if name is not None:
            self.named[kind, name] = made
        return made

    def enumerator(self):
        tag = self.take().strip('"')
        self.take("=")
        self.take()
        if self.peek() == ",":
            self.take()
        return tag

    def member(self, kind):
        """(tag or None, is a block, may repeat, type or None)."""
        repeated = self.peek() == "("
        if repeated:
            self.take()
        block = self.peek() == "block"
        if block:
            self.take()
        tag = self.take().strip('"') if kind != "struct" else None
        inner = None if self.peek() in (";", ")*") else self.type()
        if repeated:
            self.take(")*")
        self.take(";")
        return tag, block, repeated, inner

    def check(self, name, tokens):
        """Raises AssertionError unless `tokens`, what is in a block of this name, is what the grammar allows."""
        end = match(self.blocks[name], tokens, 0)
        assert end == len(tokens), f"IF_DATA: {tokens[end : end + 4]} is not allowed here"


def match(kind, tokens, at):
    """Where behind `at` what this type takes ends."""
    what = kind[0]
    if what in RANGES:
        low, high = RANGES[what]
        assert low <= int(tokens[at], 0) <= high, tokens[at]
        return at + 1
    if what == "char":
        assert tokens[at][0] == tokens[at][-1] == '"' and len(tokens[at]) - 2 < kind[1], tokens[at]
        return at + 1
    if what == "enum":
        assert tokens[at] in kind[1], f"IF_DATA: {tokens[at]} is none of {kind[1]}"
        return at + 1
    if what == "struct":
        for _, _, _, inner in kind[1]:
            at = match(inner, tokens, at)
        return at
    seen = set()
    while at < len(tokens):
        block = tokens[at] == "/begin"
        tag = tokens[at + block]
        found = next((each for each in kind[1] if each[:2] == (tag, block)), None)
        if found is None:
            break
        _, _, repeated, inner = found
        assert repeated or tag not in seen, f"IF_DATA: {tag} twice"
        seen.add(tag)
        at += 1 + block
        if inner is not None:
            at = match(inner, tokens, at)
        if block:
            assert tokens[at : at + 2] == ["/end", tag], f"IF_DATA: {tokens[at : at + 4]} in {tag}"
            at += 2
        if what == "taggedunion":
            return at
    assert what == "taggedstruct", f"IF_DATA: {tokens[at : at + 2]} is none of {[each[0] for each in kind[1]]}"
    return at
