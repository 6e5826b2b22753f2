"""The comments of C++ sources, for the tools that read them."""
import re

CODE = ("apps", "bench", "berth", "examples", "fuzz", "tests")
# What is no comment and may look like one comes first: raw strings, strings, characters.
COMMENT = re.compile(r"""R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"|(?<!\w)'(?:\\.|[^'\\\n])+'"""
                     r"|(?P<comment>//[^\n]*|/\*.*?\*/)", re.DOTALL)


def comments(text):
    """(line, comment) of a source, line by line."""
    for match in COMMENT.finditer(text):
        if match["comment"]:
            first = text.count("\n", 0, match.start()) + 1
            yield from enumerate(match["comment"].splitlines(), first)
