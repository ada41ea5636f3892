// A click on the head of a column sorts the rows by it; what has no value comes last.
for (const table of document.querySelectorAll("table")) {
  const heads = [...table.tHead.rows[0].cells], [body] = table.tBodies, rows = [...body.rows];
  heads.forEach((head, column) => {
    if (head.tagName !== "TH") return;
    const button = document.createElement("button");
    button.append(...head.childNodes);
    head.append(button);
    button.onclick = () => {
      const sign = head.ariaSort === "ascending" ? -1 : 1;
      heads.forEach((other) => (other.ariaSort = null));
      head.ariaSort = sign > 0 ? "ascending" : "descending";
      const text = (row) => row.cells[column].querySelector("bdi").textContent.replace(/^-$/, "");
      body.append(...rows.toSorted((a, b) => {
        const [s, t] = [text(a), text(b)];
        if (!s || !t) return !s - !t;
        return sign * (isNaN(s) || isNaN(t) ? s.localeCompare(t) : s - t);
      }));
    };
  });
}
