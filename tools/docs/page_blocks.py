"""Generated parts of pages: what is between <!-- table: NAME --> and <!-- end --> in a Markdown file."""

import re


class MissingBlock(Exception):
    """A page does not have exactly one block of a name; the message names both."""


def table(header, rows):
    """A Markdown table of texts, with a line end after each row."""
    return "\n".join(["| " + " | ".join(header) + " |", "|" + "---|" * len(header),
                      *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def replace_blocks(page, blocks):
    """Writes `blocks`, a dictionary from names to texts that end with a line end, into the file `page`."""
    with open(page, encoding="utf-8") as file:
        text = file.read()
    for name, content in blocks.items():
        block = re.compile(rf"(<!-- table: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text, replaced = block.subn(lambda match, content=content: match[1] + "\n" + content + "\n" + match[2], text)
        if replaced != 1:
            raise MissingBlock(f"{page} has {replaced} tables named {name}; expected 1")
    with open(page, "w", encoding="utf-8") as file:
        file.write(text)


def short(number):
    """Three significant digits, without an exponent."""
    value = float(number)
    return f"{value:,.0f}" if value >= 100 else f"{value:#.3g}"
