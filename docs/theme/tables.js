/* Tables of measured numbers (pages under data/): a field filters the rows, a click on a heading sorts them, CSV is the table as a file. */
(() => {
  if (!/\/data\/[^/]*$/.test(location.pathname)) return;
  const value = (row, at) => {
    const text = row.cells[at]?.textContent.trim() ?? "";
    const number = parseFloat(text.replace(/^[<>]\s*/, ""));
    return /^[<>]?\s*[-+]?[\d.]/.test(text) && !Number.isNaN(number) ? number : text;
  };
  const compare = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b)));
  for (const table of document.querySelectorAll("article table")) {
    const body = table.tBodies[0];
    if (!body || body.rows.length < 4) continue;
    const rows = [...body.rows];
    [...table.tHead.rows[0].cells].forEach((head, at) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending";
        for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        rows.sort((a, b) => (down ? -1 : 1) * compare(value(a, at), value(b, at)));
        body.append(...rows);
      });
    });
    const field = document.createElement("input");
    field.type = "search";
    field.className = "filter";
    field.placeholder = "Show rows with …";
    field.setAttribute("aria-label", "Show rows with");
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of rows) row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word));
    });
    const file = document.createElement("a");
    file.className = "csv";
    file.textContent = "CSV";
    file.download = `${location.pathname.split("/").pop().replace(/\.html$/, "")}.csv`;
    const cell = (each) => `"${each.textContent.trim().replaceAll('"', '""')}"`;
    const lines = [...table.rows].map((row) => [...row.cells].map(cell).join(","));
    file.href = URL.createObjectURL(new Blob([lines.join("\r\n")], { type: "text/csv" }));
    (table.closest(".md-typeset__scrollwrap") ?? table).before(field, file);
  }
})();
