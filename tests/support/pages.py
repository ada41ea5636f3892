"""A reader of HTML pages that checks them, and of tables before they are printed."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Checks that tags are balanced; collects tags, attributes, addresses, words, rows of cells."""

    def __init__(self, text):
        super().__init__()
        self.open, self.addresses, self.words, self.rows = [], [], [], []
        self.tags, self.attributes = set(), set()
        self.feed(text)
        assert self.open == []

    @property
    def text(self):
        """All words, with single spaces."""
        return " ".join(" ".join(self.words).split())

    @property
    def pictures(self):
        """Addresses of pictures of scenes and questions."""
        return [address for address in self.addresses if address.startswith("data:image/webp")]

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes.update(name for name, _ in attrs)
        self.addresses += [value for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img"):  # others that have no end end with />
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)
        if "td" in self.open or "th" in self.open:
            self.rows[-1][-1] += f" {data}" if "small" in self.open else data


def cells_of(table):
    """Return the texts of a table's rows by their names, without the columns up to these."""
    first = table.named_by + 1
    return {row.cells[first - 1].value: [str(c) for c in row.cells[first:]] for row in table.rows}
