"use strict";
// Asks for the state of the build until it has ended. The server answers at the next change, or after a second.

const $ = (id) => document.getElementById(id);

function element(tag, text, kind = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  made.className = kind;
  return made;
}

function line(item, ...words) {
  const made = element("div", "", "line");
  made.append(element("span", item.name, "name"), ...words.filter(Boolean).map((word) => element("span", word, "soft")));
  return made;
}

function fill(id, items, made) {
  const rows = items.map((item) => {
    const row = element("li", "", item.embedded ? "embedded" : "");
    row.append(...made(item));
    return row;
  });
  $(id).querySelector("ol").replaceChildren(...rows);
  $(id).hidden = !items.length;
  const count = $(id).querySelector("small");
  if (count) count.textContent = items.length;
}

// The bar is the time so far, on one scale for all packages; the mark is the time of the last build.
function bar(item) {
  const made = element("div", "", "amount"), now = document.createElement("i"), expected = document.createElement("b");
  now.style.width = item.width;
  made.append(now);
  if (item.last) {
    expected.style.left = item.expected;
    expected.title = `last build: ${item.last}`;
    made.append(expected);
  }
  return made;
}

function runningRow(item) {
  const step = item.share === null ? item.step : `${item.step} ${item.share} %`;
  const time = item.last ? `${item.elapsed} of ${item.last}` : item.elapsed;
  const memory = item.memory && (item.peak ? `${item.memory}, peak ${item.peak}` : item.memory);
  const users = item.users && `${item.users} ${item.users === 1 ? "package waits" : "packages wait"} for it`;
  return [line(item, step, time), bar(item), element("small", [memory, users].filter(Boolean).join(" · "))];
}

function waitingRow(item) {
  const made = line(item);
  const words = element("span", item.needs.length ? "" : `for ${item.reason}`, "soft");
  item.needs.forEach((need, index) => {
    words.append(index ? ", " : "for ", element("span", need.name, need.running ? "running" : ""));
  });
  made.append(words);
  return [made];
}

function show(state) {
  const failed = state.ended_packages.filter((item) => item.outcome === "failed");
  const stopped = state.ended_packages.some((item) => item.outcome === "aborted" || item.words === "interrupted");
  const built = state.ended_packages.filter((item) => item.outcome === "finished" || item.outcome === "unchanged");
  document.body.classList.toggle("ended", state.ended);
  $("headline").textContent = state.ended
    ? (failed.length ? "The build has failed" : stopped ? "The build was stopped" : "The build has ended")
    : `${state.done} of ${state.total} packages`;
  document.title = state.ended ? $("headline").textContent : `${state.share} % · ${$("headline").textContent}`;
  const progress = $("progress");
  progress.querySelector("i").style.width = `${state.share}%`;
  progress.setAttribute("aria-valuenow", state.share);
  const left = state.left ? `${state.unsure ? "at least" : "about"} ${state.left} left` : "";
  const counted = state.ended ? `${built.length} of ${state.total} packages` : "";
  $("estimate").textContent = [counted, state.elapsed, left].filter(Boolean).join(" · ");
  const { busy, processors, used, memory } = state.usage;
  $("usage").textContent = memory && !state.ended ? `${busy} of ${processors} processors busy · ${used} of ${memory} in use` : "";
  fill("failures", failed, (item) => [line(item, item.words)]);
  fill("running", state.running, runningRow);
  fill("waiting", state.waiting, waitingRow);
  const words = { finished: "", unchanged: "unchanged", skipped: "not started, because of", aborted: "stopped" };
  const others = state.ended_packages.filter((item) => item.outcome !== "failed");
  fill("done", others, (item) => [line(item, [words[item.outcome], item.words].filter(Boolean).join(" "))]);
}

async function follow() {
  let version = "";
  let last = null;
  try {
    do {
      const answer = await fetch(`state?${version}`, { cache: "no-store" });
      if (!answer.ok) throw new Error(answer.status);
      last = await answer.json();
      version = last.version;
      show(last);
    } while (!last.ended);
  } catch {
    if (last) show({ ...last, ended: true });
    $("headline").textContent = "The build has ended";
    $("estimate").textContent = "This page shows what was known last.";
  }
}

follow();
