// The page of a watch: takes in messages, keeps the last hours, draws what is looked at. What comes from the data is only
// ever put into text and pictures, never into markup.
import { bearingAt, clock, drawExistence, drawRecord, endsOf, rowAt, trackColour, visible } from "./drawing.js";
import { drawMap, placeAt } from "./map.js";

const MOST = 7200; // scans that are kept
const find = (id) => document.getElementById(id);
const record = find("record"), existence = find("existence");
const view = { offset: 0, rows: 240 };
let greeting = null, scans = [], paused = false, night = false, chosen = 0, dirty = true, wait = 1000, counts = {};
let order = { name: "label", up: true };
const since = new Map();

const SIGNS = { degree: "°", "degree/s": " °/s", pixel: "", "pixel/s": " a second" };

// What the table tells: the place with two deviations, rates and levels by themselves.
function columnsOf(greeting) {
  const places = new Set(greeting.places.map((place) => place.name));
  return [
    ["label", "Track", (t) => String(t.label)],
    ["since", "Since", (t) => clock(t.since, greeting)],
    ...greeting.columns.map(({ name, title, unit }) => {
      const sign = SIGNS[unit] ?? ` ${unit}`, digits = unit === "degree/s" ? 3 : unit === "m" ? 0 : 1;
      return [name, title, (t) => `${number(t[name], digits)}${sign}`
        + (places.has(name) ? ` ± ${number(2 * t[`${name}_std`], digits)}${sign}` : "")];
    }),
    ["existence", "Existence", (t) => number(t.existence, 3)],
  ];
}
let columns = [];

// Where a track is, in words.
function whereOf(track) {
  return greeting.places.map(({ name, unit }) =>
    greeting.places.length > 1 ? `${name.replace(/_m$/, "")} ${number(track[name], 0)}${SIGNS[unit] ?? ` ${unit}`}`
      : `${number(track[name], 1)}${SIGNS[unit] ?? ` ${unit}`}`).join(", ");
}

function number(value, digits) {
  return value === null || value === undefined || Number.isNaN(value) ? "not known" : value.toFixed(digits);
}

export function scanOf(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const scan = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  scan.row = new Uint8Array(buffer, 4 + length);
  return scan;
}

function take(scan) {
  if (scans.length && scan.scan <= scans[scans.length - 1].scan) return;
  if (paused && scans.length) view.offset += scan.scan - scans[scans.length - 1].scan;
  scans.push(scan);
  if (scans.length > MOST) scans.splice(0, scans.length - MOST);
  for (const track of scan.tracks) {
    if (!since.has(track.label)) since.set(track.label, scan.time);
    track.since = since.get(track.label);
  }
  if (since.size > 1000) for (const label of [...since.keys()].slice(0, 500)) since.delete(label);
  counts = scan.status;
  dirty = true;
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(`${scheme}//${location.host}/scans`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { wait = 1000; find("link").textContent = "live"; };
  socket.onmessage = (message) => {
    if (typeof message.data !== "string") return take(scanOf(message.data));
    const event = JSON.parse(message.data);
    if (event.event === "greeting") greet(event);
    else if (event.event === "alarm") alarm(event);
    else if (event.event === "misfit") misfit(event);
    else if (event.event === "remark") notice(`remark/${event.text.replace(/[0-9][0-9.,e+-]*/g, "")}`, event.text, "remark");
  };
  socket.onclose = () => {
    find("link").textContent = `no connection; again in ${Math.round(wait / 1000)} s`;
    setTimeout(connect, wait);
    wait = Math.min(2 * wait, 30000);
  };
}

function greet(event) {
  if (greeting && (greeting.source !== event.source || greeting.start_time !== event.start_time)) {
    scans = []; since.clear();
  }
  greeting = event;
  find("source").textContent = event.source;
  columns = columnsOf(event);
  headings();
  dirty = true;
}

function alarm(event) {
  const where = greeting ? `, ${whereOf(event)}` : "";
  notice(`${event.name}/${event.label}`,
    `${clock(event.time, greeting)}  ${event.name}: track ${event.label}${where}`);
}

function misfit(event) {
  // Of one kind of sentence the numbers change from hour to hour.
  notice(`misfit/${event.text.split(":")[0]}`, `Existence is unsure. ${event.text}`);
}

const noticed = new Set();
function notice(key, text, kind = "") {
  if (noticed.has(key)) return;
  noticed.add(key);
  const said = document.createElement("p");
  said.textContent = text; said.className = kind;
  const dismiss = document.createElement("button");
  dismiss.textContent = "Seen";
  dismiss.onclick = () => said.remove();
  said.append(" ", dismiss);
  find("alarms").prepend(said);
  while (find("alarms").children.length > 20) find("alarms").lastChild.remove();
}

function headings() {
  find("headings").replaceChildren();
  for (const [name, title] of columns) {
    const cell = document.createElement("th"), button = document.createElement("button");
    cell.scope = "col"; button.textContent = title;
    button.onclick = () => { order = { name, up: order.name === name ? !order.up : true }; dirty = true; };
    cell.append(button); cell.dataset.name = name; find("headings").append(cell);
  }
}

function rows(now) {
  for (const cell of find("headings").children) {
    cell.setAttribute("aria-sort", cell.dataset.name !== order.name ? "none" : order.up ? "ascending" : "descending");
  }
  const tracks = now ? [...now.tracks] : [];
  tracks.sort((a, b) => (order.up ? 1 : -1) * ((a[order.name] ?? 0) - (b[order.name] ?? 0)));
  find("caption").textContent = tracks.length ? `${tracks.length} in hand` : "No track in hand";
  const body = find("tracks");
  const focused = document.activeElement && document.activeElement.dataset ? document.activeElement.dataset.label : null;
  body.replaceChildren(...tracks.map((track) => {
    const row = document.createElement("tr");
    row.tabIndex = 0; row.dataset.label = track.label;
    row.setAttribute("aria-selected", String(track.label === chosen));
    const choose = () => { chosen = chosen === track.label ? 0 : track.label; dirty = true; };
    row.onclick = choose;
    row.onkeydown = (event) => { if (event.key === "Enter") choose(); };
    for (const [name, , text] of columns) {
      const cell = document.createElement("td");
      if (name === "label") {
        const mark = document.createElement("span");
        mark.className = "mark"; mark.style.background = trackColour(track.label, night); cell.append(mark);
      }
      cell.append(text(track)); row.append(cell);
    }
    return row;
  }));
  if (focused) { const row = body.querySelector(`tr[data-label="${CSS.escape(focused)}"]`); if (row) row.focus(); }
}

function state(now) {
  const facts = [
    ["behind the stream", `${number(counts.behind_s ?? 0, 1)} s`, counts.behind_s > 5],
    ["gaps", `${counts.gaps ?? 0}, ${number(counts.missing_s ?? 0, 1)} s`, counts.gaps > 0],
    ["scans left out", String(counts.left_out ?? 0), counts.left_out > 0],
    ...["lost", "late", "doubled", "malformed", "begun_anew"].filter((name) => counts[name])
      .map((name) => [`packets ${name.replace("_", " ")}`, String(counts[name]), true]),
    ["largest existence", now ? number(now.existence, 3) : "not known", false],
  ];
  find("state").replaceChildren(...facts.map(([name, value, worse]) => {
    const pair = document.createElement("div"), title = document.createElement("dt"), text = document.createElement("dd");
    title.textContent = name; text.textContent = value; pair.className = worse ? "worse" : "";
    pair.append(title, text);
    return pair;
  }));
}

function draw() {
  if (dirty) {
    dirty = false;
    const map = greeting && greeting.places.length > 1;
    if (map) drawMap(record, scans, view, greeting, chosen, night);
    else drawRecord(record, scans, view, greeting, chosen, night);
    drawExistence(existence, scans, view, greeting, chosen, night);
    const shown = visible(scans, view), now = shown.length ? shown[0][1] : null;
    rows(now); state(now);
    if (now) {
      const said = now.tracks.map((t) => `track ${t.label} at ${whereOf(t)}`).join(", ");
      record.setAttribute("aria-label", `${map ? "Map" : "Places over time"} at ${clock(now.time, greeting)}: ${said || "no track"}`);
      find("clock").textContent = clock(now.time, greeting) + (greeting.start_time ? " UTC" : "");
    }
  }
  requestAnimationFrame(draw);
}

function pause(wanted) {
  paused = wanted;
  find("pause").setAttribute("aria-pressed", String(paused));
  if (!paused) view.offset = 0;
  dirty = true;
}

function scroll(by) {
  const span = scans.length ? scans[scans.length - 1].scan - scans[0].scan : 0;
  const offset = Math.max(0, Math.min(span, view.offset + Math.round(by)));
  if (offset) pause(true);
  view.offset = offset;
  if (!offset) pause(false);
  dirty = true;
}

function zoom(factor) { view.rows = Math.max(30, Math.min(MOST, Math.round(view.rows * factor))); dirty = true; }

function dim() {
  night = !night;
  document.documentElement.classList.toggle("night", night);
  find("night").setAttribute("aria-pressed", String(night));
  dirty = true;
}

const KEYS = {
  " ": () => pause(!paused), ArrowDown: () => scroll(view.rows / 10), ArrowUp: () => scroll(-view.rows / 10),
  PageDown: () => scroll(view.rows), PageUp: () => scroll(-view.rows), Home: () => pause(false),
  "+": () => zoom(0.5), "-": () => zoom(2), n: dim, N: dim,
};
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || !(event.key in KEYS)) return;
  // A button that has the focus is pressed by Space itself.
  if (event.key === " " && event.target instanceof HTMLButtonElement) return;
  event.preventDefault();
  KEYS[event.key]();
});
find("pause").onclick = () => pause(!paused);
find("older").onclick = () => scroll(view.rows / 2);
find("newer").onclick = () => scroll(-view.rows / 2);
find("closer").onclick = () => zoom(0.5);
find("farther").onclick = () => zoom(2);
find("night").onclick = dim;
record.addEventListener("wheel", (event) => { event.preventDefault(); scroll(Math.sign(event.deltaY) * view.rows / 10); }, { passive: false });
record.addEventListener("pointerleave", () => { find("hover").textContent = ""; });
record.addEventListener("pointermove", (event) => {
  if (!greeting || !scans.length) return;
  const place = greeting.places[0], sign = SIGNS[place.unit] ?? ` ${place.unit}`;
  if (greeting.places.length > 1) {
    const [x, y] = placeAt(event.offsetX, event.offsetY, record, scans, view, greeting);
    find("hover").textContent = `${number(x, 0)}, ${number(y, 0)}${sign}`;
    return;
  }
  const value = bearingAt(event.offsetX, record.clientWidth, endsOf(scans, view, greeting));
  const row = rowAt(event.offsetY, record.clientHeight, view);
  const hit = visible(scans, view).find(([number_]) => number_ === row);
  const [first, last] = endsOf(scans, view, greeting);
  if (!hit || !(value >= Math.min(first, last))) return;
  const scan = hit[1], share = (value - first) / (last - first);
  const level = scan.low_db + (scan.row[Math.round(share * (scan.row.length - 1))] / 255) * (scan.high_db - scan.low_db);
  find("hover").textContent = `${clock(scan.time, greeting)}  ${number(value, 1)}${sign}`
    + (scan.row.length ? `  ${number(level, 1)} dB` : "");
});
new ResizeObserver(() => { dirty = true; }).observe(record);
connect();
requestAnimationFrame(draw);
