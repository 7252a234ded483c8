for (const table of document.querySelectorAll("table.sortable")) {
  const [body] = table.tBodies;
  const heads = [...table.tHead.rows[0].cells];
  const words = new Intl.Collator("en", { numeric: true });

  const number = cell => cell.dataset.value === undefined ? NaN : Number(cell.dataset.value);
  // What has no number stays at the end, whichever way the others go.
  const byNumber = sign => (a, b) =>
    isNaN(number(a)) - isNaN(number(b)) || sign * (number(a) - number(b)) || 0;
  const byText = sign => (a, b) => sign * words.compare(a.textContent, b.textContent);

  const sort = (column, direction) => {
    const sign = direction === "ascending" ? 1 : -1;
    const compare = (heads[column].dataset.order === "number" ? byNumber : byText)(sign);
    const rows = [...body.rows];
    rows.sort((a, b) => compare(a.cells[column], b.cells[column]));
    body.append(...rows);
    for (const head of heads) head.removeAttribute("aria-sort");
    heads[column].setAttribute("aria-sort", direction);
  };

  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const again = head.getAttribute("aria-sort") === "ascending";
      sort(column, again ? "descending" : "ascending");
    });
  });
}
