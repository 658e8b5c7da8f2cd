"use strict";
// Zoom, search, selection and sortable tables. `facts.packages[n]` describes the bar with data-number n; all times
// are seconds since the start of the build.

const facts = JSON.parse(document.getElementById("facts").textContent);
const packages = facts.packages;
const $ = (id) => document.getElementById(id);
const bars = [...document.querySelectorAll("#bars .row")];
const scroll = $("scroll"), sheet = $("sheet"), axis = $("axis").querySelector(".track");
const users = packages.map(() => []);
packages.forEach((item, number) => item.needs.forEach((need) => users[need].push(number)));

// The width of the names that cover the left of the tracks; on narrow screens they stand above them.
const covered = () => {
  const name = bars[0]?.querySelector(".name");
  return name && getComputedStyle(bars[0]).display === "flex" ? name.offsetWidth : 0;
};

const spoken = (seconds) => {
  if (seconds < 60) return `${Number(seconds.toFixed(2))}s`;
  const minutes = Math.floor(seconds / 60), rest = Number((seconds % 60).toFixed(1));
  return rest ? `${minutes}min ${rest}s` : `${minutes}min`;
};

// --- zoom: changes the width of the sheet; positions on it are percentages

let zoom = 1;

function look(wanted, at = axis.getBoundingClientRect().left + scroll.clientWidth / 2) {
  const before = axis.getBoundingClientRect();
  const share = (at - before.left) / before.width;
  zoom = Math.min(400, Math.max(1, wanted));
  sheet.style.setProperty("--zoom", zoom);
  const after = axis.getBoundingClientRect();
  scroll.scrollLeft += after.left + share * after.width - at;
  drawAxis();
}

function drawAxis() {
  const room = axis.getBoundingClientRect().width / 90;
  const least = facts.seconds / Math.max(1, room);
  const unit = 10 ** Math.floor(Math.log10(least || 1));
  const nice = [1, 2, 5, 10].map((factor) => factor * unit).find((step) => step >= least) ?? unit;
  const step = nice > 10 ? [15, 30, 60, 120, 300, 600, 1800, 3600].find((whole) => whole >= least) ?? nice : nice;
  const marks = [];
  for (let count = 0; count * step <= facts.seconds; count += 1) {
    const mark = document.createElement("span");
    mark.textContent = spoken(count * step);
    mark.style.left = `${(100 * count * step) / facts.seconds}%`;
    marks.push(mark);
  }
  axis.replaceChildren(...marks);
}

$("closer").addEventListener("click", () => look(zoom * 1.5));
$("farther").addEventListener("click", () => look(zoom / 1.5));
$("whole").addEventListener("click", () => look(1));
scroll.addEventListener("wheel", (event) => {
  if (!event.ctrlKey) return;
  look(zoom * Math.exp(-event.deltaY * 0.005), event.clientX);
  event.preventDefault();
}, { passive: false });
window.addEventListener("resize", drawAxis);

// --- the mouse position

const rest = $("reading").textContent;

function lastBefore(pairs, time) {
  let low = 0, high = pairs.length;
  while (low < high) {
    const half = (low + high) >> 1;
    if (pairs[half][0] <= time) low = half + 1;
    else high = half;
  }
  return low - 1;
}

scroll.addEventListener("pointermove", (event) => {
  const frame = axis.getBoundingClientRect();
  const time = ((event.clientX - frame.left) / frame.width) * facts.seconds;
  const row = event.target.closest("#bars .row");
  const outside = time < 0 || time > facts.seconds || event.clientX < scroll.getBoundingClientRect().left + covered();
  $("cursor").hidden = outside;
  if (outside) return row ? read(Number(row.dataset.number)) : undefined;
  $("cursor").style.left = `${event.clientX - sheet.getBoundingClientRect().left}px`;
  const words = [`at ${spoken(time)}`, `packages at work: ${facts.atWork[lastBefore(facts.atWork, time)]?.[1] ?? 0}`];
  const sample = facts.samples[lastBefore(facts.samples, time) + 1];
  if (sample) words.push(`processors busy: ${sample[1].toFixed(1)} of ${facts.processors}`, `memory in use: ${(sample[2] / 1e9).toFixed(1)} GB`);
  if (row) words.push(sentence(Number(row.dataset.number)));
  $("reading").textContent = words.join(" · ");
});
scroll.addEventListener("pointerleave", () => {
  $("cursor").hidden = true;
  $("reading").textContent = rest;
});

function sentence(number) {
  const item = packages[number];
  const steps = item.steps.map((step) => `${step.label} ${step.took}`);
  return `${item.name}: ${item.took}${steps.length ? ` (${steps.join(", ")})` : ""}`;
}

function read(number) {
  $("reading").textContent = sentence(number);
}

// --- the selected package

let chosen = null;

function choose(number) {
  chosen = number;
  const item = packages[number];
  const needs = new Set(item?.needs), needed = new Set(users[number]);
  $("bars").classList.toggle("choosing", number !== null);
  bars.forEach((row, index) => {
    row.classList.toggle("chosen", index === number);
    row.classList.toggle("need", needs.has(index));
    row.classList.toggle("user", needed.has(index));
  });
  $("card").hidden = number === null;
  if (number === null) return;
  tell(item, needs, needed);
  // Keep the card from covering the selected bar.
  const bar = bars[number].getBoundingClientRect();
  $("card").classList.toggle("high", bar.top > window.innerHeight / 2);
}

function tell(item, needs, needed) {
  const words = { finished: "took", taken: "restored from the cache in", failed: "failed after", aborted: "was stopped after" };
  $("name").textContent = item.name;
  const last = item.last ? `, previously ${item.last}` : "";
  const waited = item.waited ? `, waited ${item.waited} for a job` : "";
  $("what").textContent = `${words[item.outcome]} ${item.took}${last}; started at ${spoken(item.begun)}${waited}`;
  $("reason").textContent = `Built because: ${item.reason}`;
  $("steps").replaceChildren(...item.steps.map((step) => line(step.label, step.code ? `${step.took}, exit code ${step.code}` : step.took)));
  list($("needs"), needs);
  list($("users"), needed);
}

function line(...words) {
  const row = document.createElement("tr");
  for (const word of words) row.insertCell().textContent = word;
  return row;
}

function list(place, numbers) {
  place.replaceChildren(...[...numbers].map((number) => {
    const item = document.createElement("li"), made = document.createElement("button");
    made.className = "go";
    made.dataset.number = number;
    made.textContent = packages[number].name;
    item.append(made);
    return item;
  }));
  if (!numbers.size) place.textContent = "none";
}

function goTo(number) {
  search("");
  $("only").checked = false;
  show();
  choose(number);
  const bar = bars[number].querySelector(".bar");
  reachable(number);
  bar.focus({ preventScroll: true });
  bars[number].scrollIntoView({ block: "center", inline: "nearest" });
  // The names cover the left of the sheet and hide bars below them.
  const room = scroll.getBoundingClientRect(), box = bar.getBoundingClientRect();
  const names = covered();
  if (box.right < room.left + names || box.left > room.right) scroll.scrollLeft += box.left - room.left - names - 40;
  $("chart").scrollIntoView({ block: "nearest" });
}

document.addEventListener("click", (event) => {
  const go = event.target.closest(".go");
  if (go) goTo(Number(go.dataset.number));
});
$("bars").addEventListener("click", (event) => {
  const row = event.target.closest(".row");
  if (row) choose(Number(row.dataset.number) === chosen ? null : Number(row.dataset.number));
});
$("close").addEventListener("click", () => choose(null));

// --- search

function search(text) {
  if ($("search").value !== text) $("search").value = text;
  show();
}

function show() {
  const wanted = $("search").value.trim().toLowerCase();
  let count = 0;
  bars.forEach((row, number) => {
    const fits = packages[number].name.toLowerCase().includes(wanted) && !($("only").checked && !row.classList.contains("critical"));
    row.hidden = !fits;
    count += fits;
  });
  for (const row of $("packages-table").tBodies[0].rows) row.hidden = bars[row.dataset.number].hidden;
  $("count").textContent = wanted || $("only").checked ? `${count} of ${packages.length}` : "";
  const first = bars.find((row) => !row.hidden);
  if (first && bars[current]?.hidden) reachable(Number(first.dataset.number));
}

$("search").addEventListener("input", show);
$("only").addEventListener("change", show);

// --- keyboard: Tab focuses one bar, arrow keys move to the others

let current = 0;

function reachable(number) {
  bars[current]?.querySelector(".bar").setAttribute("tabindex", "-1");
  current = number;
  bars[current]?.querySelector(".bar").setAttribute("tabindex", "0");
}

function step(direction) {
  let next = current + direction;
  while (bars[next]?.hidden) next += direction;
  if (!bars[next]) return;
  reachable(next);
  bars[next].querySelector(".bar").focus({ preventScroll: true });
  bars[next].scrollIntoView({ block: "nearest" });
  if (chosen !== null) choose(next);
}

$("bars").addEventListener("keydown", (event) => {
  const direction = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!direction) return;
  step(direction);
  event.preventDefault();
});
$("bars").addEventListener("focusin", (event) => {
  const row = event.target.closest(".row");
  if (!row) return;
  reachable(Number(row.dataset.number));
  read(current);
});
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") {
    search("");
    choose(null);
  }
  if (event.target.matches("input") || event.ctrlKey || event.metaKey || event.altKey) return;
  const done = { "/": () => $("search").focus(), "+": () => look(zoom * 1.5), "=": () => look(zoom * 1.5), "-": () => look(zoom / 1.5), 0: () => look(1) }[event.key];
  if (!done) return;
  done();
  event.preventDefault();
});

// --- tables: click a column to sort by it, click again to reverse the order

const heads = [...$("packages-table").tHead.rows[0].cells];
heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
  const down = head.getAttribute("aria-sort") ? head.getAttribute("aria-sort") === "ascending" : column > 0;
  heads.forEach((other) => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const value = (row) => row.cells[column].dataset.value;
  const order = column ? (a, b) => value(a) - value(b) : (a, b) => value(a).localeCompare(value(b));
  const body = $("packages-table").tBodies[0];
  body.append(...[...body.rows].sort((a, b) => (down ? -1 : 1) * order(a, b)));
}));

// --- start

bars.forEach((row) => row.querySelector(".bar").setAttribute("tabindex", "-1"));
reachable(0);
drawAxis();
