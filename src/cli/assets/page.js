"use strict";
// Filter by structure, sorting, emphasis and copying; the state is in the hash of the address.
(() => {
  const all = (selector, from = document) => [...from.querySelectorAll(selector)];
  const el = (tag, text, props = {}) => Object.assign(document.createElement(tag), { textContent: text, ...props });
  const marks = new Map();
  for (const g of all("g[data-s]")) {
    const name = g.dataset.s;
    if (!marks.has(name) && g.querySelector(".mark")) marks.set(name, g);
  }
  const tables = all("table");
  const off = new Set();
  const sorts = new Map();

  // Numbers with a unit, such as "1.81 us [1.75, 1.90]"; text otherwise.
  const UNITS = { ns: 1, us: 1e3, ms: 1e6, s: 1e9 };
  const value = (cell) => {
    const found = /^[*<>~= ]*(-?[\d,]*\.?\d+(?:e-?\d+)?)(?:±[\d.]+| \[[^\]]*\])?\s*(ns|us|ms|s)?\b/.exec(cell.textContent);
    return found ? Number(found[1].replaceAll(",", "")) * (UNITS[found[2]] || 1) : NaN;
  };
  // Shades a number by its share of the largest of its row.
  for (const row of all("table.heat tbody tr")) {
    // Without the mark of the fastest; a time is no number.
    const number = (cell) => Number(cell.textContent.replace(/[*,]/g, ""));
    const cells = all("td.n", row).filter((cell) => number(cell) > 0);
    const most = Math.max(...cells.map(number));
    for (const cell of cells) cell.style.setProperty("--v", Math.max(1 - Math.log2(most / number(cell)) / 3, 0).toFixed(2));
  }
  const order = (a, b, column) => {
    const [x, y] = [a, b].map((row) => row.cells[column]);
    if (!x.textContent || !y.textContent) return (x.textContent ? 0 : 1) - (y.textContent ? 0 : 1) || 0;
    const [m, n] = [value(x), value(y)];
    if (column > 0 && m === m && n === n) return m - n;
    const [s, t] = [x, y].map((cell) => cell.textContent.replace(/(\d),(?=\d{3})/g, "$1"));
    return s.localeCompare(t, "en", { numeric: true });
  };
  const sort = (table, column, down) => {
    const body = table.tBodies[0];
    const rows = [...body.rows];
    const last = table.className === "heat" ? rows.pop() : null;
    const filled = (row) => (row.cells[column].textContent ? 0 : 1);
    rows.sort((a, b) => filled(a) - filled(b) || (down ? -1 : 1) * order(a, b, column));
    body.append(...rows, ...(last ? [last] : []));
    all("thead th", table).forEach((th, n) => {
      if (n === column) th.setAttribute("aria-sort", down ? "descending" : "ascending");
      else th.removeAttribute("aria-sort");
    });
  };

  const show = () => {
    for (const item of all("g[data-s],tr[data-s]")) item.classList.toggle("off", off.has(item.dataset.s));
    for (const table of all("table.heat")) {
      all("thead th", table).forEach((th, n) => {
        const hide = off.has(th.textContent);
        for (const row of table.rows) row.cells[n].classList.toggle("off", hide);
      });
    }
    for (const box of all("#filter input")) box.checked = !off.has(box.value);
  };
  const keep = () => {
    const parts = [];
    if (off.size) parts.push("off=" + [...off].map(encodeURIComponent).join(","));
    if (sorts.size) parts.push("sort=" + [...sorts].map(([t, [c, d]]) => [t, c, d ? 1 : 0].join(".")).join(","));
    history.replaceState(null, "", parts.length ? "#" + parts.join("&") : location.pathname + location.search);
  };
  const decoded = (text) => {
    try { return decodeURIComponent(text); } catch { return text; }
  };
  const read = () => {
    off.clear();
    sorts.clear();
    for (const part of location.hash.slice(1).split("&")) {
      const [key, list = ""] = part.split("=");
      if (key === "off") list.split(",").map(decoded).forEach((name) => marks.has(name) && off.add(name));
      if (key === "sort") {
        for (const [t, c, d] of list.split(",").map((s) => s.split(".").map(Number))) {
          if (tables[t] && tables[t].tHead.rows[0].cells[c]) {
            sorts.set(t, [c, d === 1]);
            sort(tables[t], c, d === 1);
          }
        }
      }
    }
    show();
  };

  if (marks.size) {
    const bar = el("fieldset", "", { id: "filter" });
    bar.append(el("legend", "Show"));
    const shape = (g) => {
      const mark = g.querySelector(".mark").cloneNode();
      const svg = document.createElementNS(g.namespaceURI, "svg");
      svg.setAttribute("viewBox", "-7 -7 14 14");
      svg.append(mark);
      return svg;
    };
    for (const [name, g] of marks) {
      const label = el("label", "", { className: g.getAttribute("class").replace(/\b(s|weak)\b/g, "") });
      label.dataset.s = name;
      const box = el("input", "", { type: "checkbox", value: name, checked: true });
      box.addEventListener("change", () => {
        if (box.checked) off.delete(name);
        else off.add(name);
        show();
        keep();
      });
      label.append(box, shape(g), el("span", name));
      bar.append(label);
    }
    const flip = el("button", "all / none", { type: "button", className: "copy" });
    flip.addEventListener("click", () => {
      const hide = off.size === 0;
      off.clear();
      if (hide) for (const name of marks.keys()) off.add(name);
      show();
      keep();
    });
    bar.append(flip);
    (document.querySelector("h1 + p") || document.querySelector("h1")).after(bar);
  }

  tables.forEach((table, t) => {
    all("thead th", table).forEach((th, column) => {
      if (!th.textContent) return;
      const button = el("button", th.textContent, { type: "button", title: "sort" });
      button.addEventListener("click", () => {
        const [before, down] = sorts.get(t) || [];
        const next = before === column ? !down : false;
        sorts.set(t, [column, next]);
        sort(table, column, next);
        keep();
      });
      th.replaceChildren(button);
    });
    for (const th of all("tbody th", table)) th.title = th.textContent;
    const copy = el("button", "copy as Markdown", { type: "button", className: "copy" });
    copy.addEventListener("click", async () => {
      const seen = (cells) => [...cells].filter((cell) => !cell.classList.contains("off"));
      const line = (cells) => "| " + cells.map((c) => c.textContent.replace(/[\\|`*_<[&~]/g, "\\$&")).join(" | ") + " |";
      const head = seen(table.tHead.rows[0].cells);
      const rule = "|" + head.map((th) => (th.className === "n" ? "---:|" : "---|")).join("");
      const rows = [...table.tBodies[0].rows].filter((row) => !row.classList.contains("off"));
      const text = [line(head), rule, ...rows.map((row) => line(seen(row.cells)))].join("\n") + "\n";
      try {
        await navigator.clipboard.writeText(text);
      } catch {
        const area = el("textarea", text);
        document.body.append(area);
        area.select();
        document.execCommand("copy");
        area.remove();
      }
      copy.textContent = "copied";
      setTimeout(() => (copy.textContent = "copy as Markdown"), 1500);
    });
    table.parentElement.after(copy);
  });

  let hot = null;
  const emphasise = (name) => {
    if (name === hot) return;
    hot = name;
    document.body.classList.toggle("hot", name !== null);
    for (const item of all("[data-s]")) item.classList.toggle("hot", item.dataset.s === name);
  };
  const over = (event) => emphasise(event.target.closest?.("[data-s]")?.dataset.s ?? null);
  document.addEventListener("mouseover", over);
  document.addEventListener("focusin", over);
  // Rows keep no order from before they were sorted.
  addEventListener("hashchange", () => location.reload());
  read();
})();
