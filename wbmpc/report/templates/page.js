"use strict";
// Everything here is comfort: without it the page shows the same, unsorted, unfiltered, and with titles for tooltips.
const all = (selector, root = document) => [...root.querySelectorAll(selector)];

// The overview: filter by words and result.
const filter = document.querySelector(".filter"), rows = all(".overview tbody tr");
filter.hidden = rows.length < 2;
const buttons = all("button", filter), input = filter.querySelector("input");
// Counterfactuals stand under their scenario, by their own name only, as long as none is hidden or moved away.
const together = () => {
  const table = document.querySelector(".overview");
  table.classList.toggle("apart", rows.some((row) => row.hidden) || table.querySelector("[aria-sort]") !== null);
};
const show = () => {
  const state = buttons.find((b) => b.getAttribute("aria-pressed") === "true").dataset.state;
  const words = input.value.toLowerCase().split(/\s+/);
  for (const row of rows) {
    const text = (row.cells[0].dataset.key + " " + row.textContent).toLowerCase();
    row.hidden = (state && row.dataset.state !== state) || !words.every((word) => text.includes(word));
  }
  together();
  document.querySelector(".empty").hidden = rows.some((row) => !row.hidden);
};
input.addEventListener("input", show);
for (const button of buttons)
  button.addEventListener("click", () => {
    buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === button)));
    show();
  });

// Sorted by a column: up, down, and as it was.
for (const table of all("table[data-sortable]")) {
  const body = table.tBodies[0], original = [...body.rows];
  all("thead th", table).forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const next = { none: "ascending", ascending: "descending", descending: "none" }[head.ariaSort || "none"];
      all("thead th", table).forEach((h) => h.removeAttribute("aria-sort"));
      if (next !== "none") head.setAttribute("aria-sort", next);
      together();
      const key = (row) => row.cells[column].dataset.key ?? row.cells[column].textContent;
      const numeric = head.classList.contains("number");
      const compare = (a, b) => {
        const [p, q] = [key(a), key(b)];
        if (p === "" || q === "") return (p === "") - (q === ""); // what was not measured comes last, both ways
        return (numeric ? p - q : p.localeCompare(q)) * (next === "descending" ? -1 : 1);
      };
      body.append(...(next === "none" ? original : [...original].sort(compare)));
    });
  });
}

// The moving picture stops at a key moment.
for (const film of all(".film")) {
  const image = film.querySelector("img"), button = film.querySelector(".stop"), moving = image.src;
  if (matchMedia("(prefers-reduced-motion: reduce)").matches) continue;
  button.hidden = false;
  button.addEventListener("click", () => {
    const still = film.closest(".body").querySelector(".strip img");
    const stopped = image.src !== moving;
    image.src = stopped ? moving : still.src;
    button.textContent = stopped ? "stop" : "play";
  });
}

// One time through all curves of a run, and what each curve is there.
const valueAt = (line, x) => {
  const points = line.points, count = points.numberOfItems;
  if (!count || x < points.getItem(0).x || x > points.getItem(count - 1).x) return null;
  let low = 0, high = count - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (points.getItem(middle).x <= x) low = middle;
    else high = middle;
  }
  const [a, b] = [points.getItem(low), points.getItem(high)];
  return a.y + (b.x > a.x ? ((x - a.x) / (b.x - a.x)) * (b.y - a.y) : 0);
};
for (const motion of all(".motion")) {
  const sheets = all("[data-time]", motion), start = +motion.dataset.start, end = +motion.dataset.end;
  const cursors = sheets.map((sheet) => {
    const cursor = document.createElement("i");
    cursor.className = "cursor";
    cursor.hidden = true;
    sheet.append(cursor);
    return cursor;
  });
  const readout = document.createElement("div");
  readout.className = "readout";
  readout.hidden = true;
  motion.append(readout);
  const leave = () => [...cursors, readout].forEach((element) => (element.hidden = true));
  motion.addEventListener("pointerleave", leave);
  motion.addEventListener("pointermove", (event) => {
    const sheet = event.target.closest("[data-time]");
    if (!sheet) return leave();
    const box = sheet.getBoundingClientRect(), share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    cursors.forEach((cursor) => {
      cursor.hidden = false;
      cursor.style.left = 100 * share + "%";
    });
    const svg = sheet.querySelector("svg");
    readout.hidden = !svg;
    if (!svg) return;
    const [low, high] = [+svg.dataset.low, +svg.dataset.high], heading = document.createElement("b");
    heading.textContent = (start + share * (end - start)).toFixed(2) + " s";
    readout.replaceChildren(heading);
    for (const line of all("polyline", svg)) {
      const y = valueAt(line, 1000 * share);
      if (y === null) continue;
      const row = document.createElement("div"), dot = document.createElement("i");
      dot.className = line.classList[0];
      row.append(dot, `${line.dataset.label} ${(high - (y / 1000) * (high - low)).toPrecision(4)} ${svg.dataset.unit}`);
      readout.append(row);
    }
    const whole = motion.getBoundingClientRect(), right = share > 0.6;
    readout.style.top = box.top - whole.top + 6 + "px";
    readout.style.left = right ? "auto" : event.clientX - whole.left + 14 + "px";
    readout.style.right = right ? whole.right - event.clientX + 14 + "px" : "auto";
  });
}

// A link to a run opens it; paper shows all of it.
const openTarget = () => document.getElementById(location.hash.slice(1))?.closest("details")?.setAttribute("open", "");
addEventListener("hashchange", openTarget);
for (const link of all('.overview a[href^="#"]'))
  link.addEventListener("click", () => document.getElementById(link.hash.slice(1))?.setAttribute("open", ""));
openTarget();
addEventListener("beforeprint", () => all("details.run").forEach((run) => run.setAttribute("open", "")));
