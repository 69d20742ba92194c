"use strict";
// Builds the page from its data (docs/report.md, "Data of the page"). Every text is set as text, never as markup.
(() => {
  const FOLDED = 25;  // a table with more rows is opened by hand
  const data = JSON.parse(document.getElementById("data").textContent);
  const main = document.querySelector("main");
  const add = (parent, tag, className, text) => {
    const made = Plot.element(tag, className, text);
    parent.append(made);
    return made;
  };

  function addTiles(parent, tiles) {
    const grid = add(parent, "div", "tiles");
    for (const tile of tiles) {
      const box = add(grid, "div", "tile");
      add(box, "small", "", tile.label);
      add(box, "b", "", tile.value);
      add(box, "small", "", tile.note);
    }
  }

  function addTable(parent, table) {
    let place = parent;
    if (table.rows.length > FOLDED) {
      place = add(parent, "details");
      add(place, "summary", "", `${table.rows.length} rows`);
    }
    const made = add(add(place, "div", "scroll"), "table");
    const head = add(add(made, "thead"), "tr");
    table.columns.forEach((name) => add(head, "th", "", name));
    const body = add(made, "tbody");
    for (const row of table.rows) {
      const line = add(body, "tr");
      row.forEach((value) => add(line, "td", "", value));
    }
  }

  function addSection(section) {
    add(main, "h2", "", section.heading);
    if (section.text) add(main, "p", "", section.text);
    (section.tables || []).forEach((table) => addTable(main, table));
    const figure = section.figure;
    if (figure) {
      const plots = add(main, "div", figure.columns > 3 ? "plots small" : "plots");
      figure.axes.forEach((axes) => Plot.add(plots, axes, data.colors));
      const link = add(add(main, "p", "muted", "The same as a picture: "), "a", "", section.png);
      link.href = section.png;
    }
  }

  document.title = data.title;
  add(main, "h1", "", data.title);
  add(main, "p", "muted", data.subtitle);
  addTiles(main, data.tiles);
  data.warnings.forEach((text) => add(main, "p", "warning", text));
  data.sections.forEach(addSection);
})();
