"""A reader of HTML pages that checks them."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Checks that tags are balanced; collects tags, attributes, addresses, words, rows of cells."""

    def __init__(self, text):
        super().__init__()
        self.open, self.addresses, self.words, self.rows = [], [], [], []
        self.tags, self.attributes = set(), set()
        self.feed(text)
        assert self.open == []

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
            self.rows[-1][-1] += data
