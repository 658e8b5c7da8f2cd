"use strict";
// The interactive dependency graph. `packages[n]` describes the node with data-number n: `needs` are the numbers of
// its dependencies, `lines` those of them with an edge.

const packages = JSON.parse(document.getElementById("packages").textContent);
const $ = (id) => document.getElementById(id);
const svg = $("graph"), world = $("world");
const nodes = [...svg.querySelectorAll(".node")];
const rows = [...$("list").querySelectorAll("li")];
const lines = [...svg.querySelectorAll(".line")];
const users = packages.map(() => []);
packages.forEach((item, number) => item.lines.forEach((need) => users[need].push(number)));
const layers = Math.max(...nodes.map((node) => Number(node.dataset.layer) + 1));
const left = (number) => packages[number].lines;
const right = (number) => users[number];

// --- the viewport

const view = { x: 0, y: 0, scale: 1, all: true };
const size = { width: Number(svg.dataset.width), height: Number(svg.dataset.height) };

function look(x, y, scale, all = false) {
  Object.assign(view, { x, y, scale: Math.min(4, Math.max(0.05, scale)), all });
  world.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.scale})`);
}

// The size of the area not covered by the card, which is at the right, or at the bottom of small screens.
function room() {
  const { width, height } = svg.getBoundingClientRect();
  if ($("card").hidden) return { width, height };
  return width < 700 ? { width, height: height * 0.55 } : { width: width - 360, height };
}

// Whether the list is shown in place of the drawing.
const narrow = () => getComputedStyle(svg).display === "none";

function lookAtAll() {
  if (narrow()) return;
  const { width, height } = room();
  const scale = Math.min(width / size.width, height / size.height, 1.25);
  look((width - size.width * scale) / 2, (height - size.height * scale) / 2, scale, true);
}

function zoom(factor, x, y) {
  const frame = svg.getBoundingClientRect();
  x ??= frame.width / 2;
  y ??= frame.height / 2;
  const scale = Math.min(4, Math.max(0.05, view.scale * factor));
  look(x - ((x - view.x) * scale) / view.scale, y - ((y - view.y) * scale) / view.scale, scale);
}

// Move as little as possible to show a node outside of the card. From the overview, also zoom in as far as the
// neighbours of the node remain visible.
function bringIntoView(number) {
  if (narrow()) {
    rows[number].scrollIntoView({ block: "nearest" });
    return;
  }
  const { width, height } = room();
  const box = boxOf([number]), around = boxOf([number, ...left(number), ...right(number)]);
  const fitting = Math.min(width / around.width, height / around.height, 1.25);
  if (view.all) {
    lookAtAll();
    if (view.scale >= 0.75) return;
    if (fitting >= 0.4) {
      lookAt(around, fitting);
      return;
    }
  }
  const scale = Math.max(view.scale, 0.75);
  const inside = box.x * scale + view.x > 0 && (box.x + box.width) * scale + view.x < width
    && box.y * scale + view.y > 0 && (box.y + box.height) * scale + view.y < height;
  if (!inside || scale !== view.scale) lookAt(box, scale);
}

// The bounding box of these nodes, with a margin.
function boxOf(numbers) {
  const boxes = numbers.map((number) => nodes[number].getBBox());
  const x = Math.min(...boxes.map((box) => box.x)) - 16, y = Math.min(...boxes.map((box) => box.y)) - 16;
  const right = Math.max(...boxes.map((box) => box.x + box.width)) + 16;
  const bottom = Math.max(...boxes.map((box) => box.y + box.height)) + 16;
  return { x, y, width: right - x, height: bottom - y };
}

function lookAt(box, scale) {
  const { width, height } = room();
  look(width / 2 - (box.x + box.width / 2) * scale, height / 2 - (box.y + box.height / 2) * scale, scale);
}

// --- the selected package

let chosen = null;

// All nodes reachable from a node, without the node itself.
function reach(number, following) {
  const found = new Set(), waiting = [...following(number)];
  while (waiting.length) {
    const next = waiting.pop();
    if (!found.has(next)) {
      found.add(next);
      waiting.push(...following(next));
    }
  }
  return found;
}

function choose(number, { focus = false } = {}) {
  chosen = number;
  const some = number !== null;
  const below = some ? reach(number, left) : new Set();
  const above = some ? reach(number, right) : new Set();
  svg.classList.toggle("choosing", some);
  nodes.forEach((node, index) => {
    node.classList.toggle("chosen", index === number);
    node.classList.toggle("below", below.has(index));
    node.classList.toggle("above", above.has(index));
    node.setAttribute("aria-pressed", String(index === number));
    rows[index].classList.toggle("chosen", index === number);
    rows[index].classList.toggle("below", below.has(index));
    rows[index].classList.toggle("above", above.has(index));
  });
  for (const line of lines) {
    const [need, user] = [Number(line.dataset.need), Number(line.dataset.user)];
    const isBelow = below.has(need) && (user === number || below.has(user));
    const isAbove = above.has(user) && (need === number || above.has(need));
    line.classList.toggle("below", isBelow);
    line.classList.toggle("above", isAbove);
    if (isBelow || isAbove) line.parentNode.append(line);
  }
  $("card").hidden = !some;
  $("help").hidden = some;
  history.replaceState(null, "", some ? `#${encodeURIComponent(packages[number].name)}` : location.pathname);
  if (!some) {
    if (view.all) lookAtAll();
    return;
  }
  tell(number, below, above);
  makeReachable(number);
  bringIntoView(number);
  if (focus) (narrow() ? rows[number].querySelector("button") : nodes[number]).focus({ preventScroll: true });
}

function tell(number, below, above) {
  const item = packages[number];
  $("name").textContent = item.name;
  $("what").textContent = [item.type, item.version].filter(Boolean).join(" · ");
  $("about").textContent = item.description;
  $("path").textContent = item.path;
  $("time").textContent = [item.time ?? "unknown", rows[number].classList.contains("critical") ? "on the critical path" : ""].filter(Boolean).join(", ");
  $("layer").textContent = `${Number(nodes[number].dataset.layer) + 1} of ${layers}`;
  $("command").textContent = `forge build --packages-up-to ${item.name}`;
  const direct = new Set(item.needs);
  const directly = new Set([...packages.keys()].filter((other) => packages[other].needs.includes(number)));
  $("needs-title").textContent = `Dependencies: ${below.size} (${direct.size} direct)`;
  $("users-title").textContent = `Dependents: ${above.size} (${directly.size} direct)`;
  list($("needs"), below, direct);
  list($("users"), above, directly);
}

function list(place, numbers, direct) {
  const names = (a, b) => direct.has(b) - direct.has(a) || packages[a].name.localeCompare(packages[b].name);
  place.replaceChildren(...[...numbers].sort(names).map((number) => {
    const item = button(number);
    item.classList.toggle("direct", direct.has(number));
    return item;
  }));
}

function button(number) {
  const item = document.createElement("li"), made = document.createElement("button");
  made.textContent = packages[number].name;
  made.addEventListener("click", () => {
    search("");
    choose(number, { focus: true });
  });
  item.append(made);
  return item;
}

// --- the search

function search(text) {
  if ($("search").value !== text) $("search").value = text;
  const wanted = text.trim().toLowerCase();
  const hits = wanted ? [...packages.keys()].filter((n) => packages[n].name.toLowerCase().includes(wanted)) : [];
  // Names that begin with the query come first.
  hits.sort((a, b) => packages[b].name.toLowerCase().startsWith(wanted) - packages[a].name.toLowerCase().startsWith(wanted));
  const found = new Set(hits);
  svg.classList.toggle("searching", wanted !== "");
  nodes.forEach((node, number) => node.classList.toggle("found", found.has(number)));
  rows.forEach((row, number) => { row.hidden = wanted !== "" && !found.has(number); });
  $("count").textContent = wanted ? `${hits.length} of ${packages.length}` : "";
  $("found").replaceChildren(...hits.slice(0, 8).map(button));
  return hits;
}

$("search").addEventListener("input", () => search($("search").value));
$("search").addEventListener("keydown", (event) => {
  const hits = event.key === "Enter" ? search($("search").value) : [];
  if (!hits.length) return;
  search("");
  choose(hits[0], { focus: true });
});

// --- keyboard: Tab focuses one node, arrow keys move to others

function makeReachable(number) {
  for (const node of svg.querySelectorAll('.node[tabindex="0"]')) node.setAttribute("tabindex", "-1");
  nodes[number].setAttribute("tabindex", "0");
}

const middle = (number) => boxOf([number]).y + boxOf([number]).height / 2;
const nearest = (number, others) =>
  [...others].sort((a, b) => Math.abs(middle(a) - middle(number)) - Math.abs(middle(b) - middle(number)))[0];

function neighbour(number, key) {
  if (key === "ArrowLeft") return nearest(number, left(number));
  if (key === "ArrowRight") return nearest(number, right(number));
  const side = (other) => (middle(other) - middle(number)) * (key === "ArrowDown" ? 1 : -1);
  const layer = nodes[number].dataset.layer;
  return nearest(number, [...nodes.keys()].filter((other) => nodes[other].dataset.layer === layer && side(other) > 0));
}

nodes.forEach((node, number) => {
  node.setAttribute("role", "button");
  node.setAttribute("aria-label", packages[number].name);
  node.setAttribute("tabindex", "-1");
  node.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") choose(number);
    else if (event.key.startsWith("Arrow")) {
      const next = neighbour(number, event.key);
      if (next === undefined) return;
      if (chosen === null) {
        makeReachable(next);
        bringIntoView(next);
        nodes[next].focus({ preventScroll: true });
      } else choose(next, { focus: true });
    } else return;
    event.preventDefault();
  });
  node.addEventListener("focus", () => node.matches(":focus-visible") && bringIntoView(number));
});

document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") {
    search("");
    choose(null);
  }
  if (event.target.matches("input") || event.ctrlKey || event.metaKey || event.altKey) return;
  const done = { "/": () => $("search").focus(), "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), 0: lookAtAll }[event.key];
  if (!done) return;
  done();
  event.preventDefault();
});

// --- mouse and touch

let hold = null;
svg.addEventListener("pointerdown", (event) => {
  if (event.button === 0) hold = { x: event.clientX, y: event.clientY, moved: false, on: event.target.closest(".node") };
});
svg.addEventListener("pointermove", (event) => {
  if (!hold) return;
  const [x, y] = [event.clientX - hold.x, event.clientY - hold.y];
  if (!hold.moved && Math.hypot(x, y) < 4) return;
  if (!hold.moved) svg.setPointerCapture(event.pointerId);
  Object.assign(hold, { x: event.clientX, y: event.clientY, moved: true });
  look(view.x + x, view.y + y, view.scale);
});
svg.addEventListener("pointerup", () => {
  if (hold && !hold.moved) choose(hold.on ? Number(hold.on.dataset.number) : null);
  hold = null;
});
svg.addEventListener("pointercancel", () => { hold = null; });
svg.addEventListener("wheel", (event) => {
  const frame = svg.getBoundingClientRect();
  zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)), event.clientX - frame.x, event.clientY - frame.y);
  event.preventDefault();
}, { passive: false });

$("closer").addEventListener("click", () => zoom(1.25));
$("farther").addEventListener("click", () => zoom(0.8));
$("whole").addEventListener("click", lookAtAll);
$("list").addEventListener("click", (event) => {
  const hit = event.target.closest("button");
  if (hit) choose(Number(hit.dataset.number) === chosen ? null : Number(hit.dataset.number));
});
$("close").addEventListener("click", () => choose(null));

// --- start

function followAnchor() {
  const number = packages.findIndex((item) => `#${encodeURIComponent(item.name)}` === location.hash);
  if (number >= 0 && number !== chosen) choose(number);
}

lookAtAll();
if (nodes.length) makeReachable(0);
window.addEventListener("resize", () => view.all && lookAtAll());
window.addEventListener("hashchange", followAnchor);
followAnchor();
