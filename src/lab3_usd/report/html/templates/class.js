"use strict";
{
  const table = document.querySelector("table.students");
  const most = Number(table.dataset.most);
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const form = document.querySelector(".filter");
  const output = form.querySelector("output");
  const more = form.querySelector("button");
  let order = rows;
  let everyone = false;

  const value = (row, column) => {
    const text = row.cells[column].textContent.trim();
    if (!table.tHead.rows[0].cells[column].classList.contains("number")) return text.toLowerCase();
    const number = Number.parseFloat(text);
    return Number.isNaN(number) ? -1 : number;
  };
  const sort = (heading, column) => {
    const down = heading.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    const sign = down ? -1 : 1;
    const keys = new Map(rows.map((row) => [row, value(row, column)]));
    order = [...rows].sort((one, other) => {
      const a = keys.get(one);
      const b = keys.get(other);
      return a < b ? -sign : a > b ? sign : 0;
    });
    body.append(...order);
    filter();
  };
  [...table.tHead.rows[0].cells].forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => sort(heading, column));
  });

  const filter = () => {
    const text = form.elements.text.value.trim().toLowerCase();
    const status = form.elements.status.value;
    let fitting = 0;
    for (const row of order) {
      const fits = (!status || row.dataset.status === status) && (!text || row.textContent.toLowerCase().includes(text));
      fitting += fits ? 1 : 0;
      row.hidden = !fits;
      row.classList.toggle("rest", fits && !everyone && fitting > most);
    }
    more.hidden = everyone || fitting <= most;
    output.textContent = `${fitting} of ${rows.length}${more.hidden ? "" : `, the first ${most} shown`}`;
  };
  more.addEventListener("click", () => {
    everyone = true;
    filter();
  });
  form.hidden = false;
  form.addEventListener("input", filter);
  form.addEventListener("change", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  filter();
}
