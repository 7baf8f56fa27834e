// Panels over one time axis and a map, on canvases. VIEWS holds the data; nothing is asked of anybody.
const COLOURS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#8a6d00", "#5b3a8c"];
const LEFT = 64, RIGHT = 10, TOP = 8, BOTTOM = 22;
const DARK = [[0, 32, 76], [60, 77, 110], [124, 123, 120], [188, 175, 111], [255, 233, 69]];
const place = document.getElementById("views"), said = document.getElementById("said");
const colour = (label) => COLOURS[(label - 1) % COLOURS.length];
const spread = Math.max(VIEWS.span[1] - VIEWS.span[0], 1e-6);
const whole = [VIEWS.span[0] - 0.01 * spread, VIEWS.span[1] + 0.01 * spread];
let shown = whole.slice(), pointed = null;

function clock(time) {
  if (VIEWS.start === null) return time.toFixed(spread < 100 ? 1 : 0) + " s";
  const moment = new Date(Date.parse(VIEWS.start.replace(/(\.\d{3})\d*/, "$1")) + 1000 * time);
  return moment.toISOString().slice(11, shown[1] - shown[0] < 20 ? 21 : 19);
}
function day(time) {
  return VIEWS.start === null ? "" : new Date(Date.parse(VIEWS.start.replace(/(\.\d{3})\d*/, "$1")) + 1000 * time).toISOString().slice(0, 10);
}
function ticks(low, high, number) {
  const rough = (high - low) / number, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= rough);
  const marks = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) marks.push(+(k * step).toPrecision(12));
  return marks;
}
function timeTicks(low, high, number) {
  if (VIEWS.start === null || (high - low) / number < 1) return ticks(low, high, number);
  const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];
  const step = steps.find((k) => k >= (high - low) / number) || 86400 * Math.ceil((high - low) / number / 86400);
  // Round times of day, not of the recording.
  const since = (Date.parse(VIEWS.start.replace(/(\.\d{3})\d*/, "$1")) / 1000) % step;
  const marks = [];
  for (let k = Math.ceil((low + since) / step); k * step - since <= high; k++) marks.push(k * step - since);
  return marks;
}
function canvas(height, title) {
  const figure = document.createElement("figure"), made = document.createElement("canvas");
  figure.style.margin = "0.6rem 0"; made.style.cssText = `width:100%;height:${height}px;touch-action:none;display:block`;
  made.setAttribute("role", "img"); made.setAttribute("aria-label", title);
  figure.appendChild(made); place.appendChild(figure);
  return made;
}
function fitted(made) {
  const ratio = window.devicePixelRatio || 1, wide = made.clientWidth, high = made.clientHeight;
  made.width = Math.round(wide * ratio); made.height = Math.round(high * ratio);
  const g = made.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0); g.font = "12px system-ui, sans-serif";
  g.fillStyle = "#fff"; g.fillRect(0, 0, wide, high);
  return [g, wide, high];
}
function picture(image) {
  const bytes = atob(image.bytes), [scans, beams] = image.shape, made = document.createElement("canvas");
  made.width = scans; made.height = beams;
  const g = made.getContext("2d"), pixels = g.createImageData(scans, beams);
  for (let scan = 0; scan < scans; scan++) for (let beam = 0; beam < beams; beam++) {
    const level = bytes.charCodeAt(scan * beams + beam) / 255 * (DARK.length - 1), k = Math.min(Math.floor(level), DARK.length - 2);
    const at = 4 * ((beams - 1 - beam) * scans + scan);
    for (let c = 0; c < 3; c++) pixels.data[at + c] = DARK[k][c] + (DARK[k + 1][c] - DARK[k][c]) * (level - k);
    pixels.data[at + 3] = 255;
  }
  g.putImageData(pixels, 0, 0);
  return made;
}
function limits(panel) {
  if (panel.range) return [panel.range[0] - 0.03, panel.range[1] + 0.03];
  if (panel.image) return panel.image.beam;
  let low = Infinity, high = -Infinity;
  for (const line of panel.tracks) line.value.forEach((value, k) => {
    if (value === null) return;
    low = Math.min(low, value - 2 * (line.std[k] || 0)); high = Math.max(high, value + 2 * (line.std[k] || 0));
  });
  if (!(high >= low)) return [0, 1];
  const room = 0.06 * (high - low) || 1;
  return [low - room, high + room];
}
function stroke(g, line, x, y, width) {
  g.strokeStyle = colour(line.label); g.lineWidth = width; g.beginPath();
  const cut = new Set(line.cut || []);
  let up = true;
  line.time.forEach((time, k) => {
    const px = x(k), py = y(k);
    if (px === null || py === null) { up = true; return; }
    if (up || cut.has(k)) g.moveTo(px, py); else g.lineTo(px, py);
    if (line.time.length === 1) g.arc(px, py, 2, 0, 7);
    up = false;
  });
  g.stroke();
}
const panels = VIEWS.panels.map((panel) => ({
  ...panel, canvas: canvas(panel.image ? 320 : panel.range ? 120 : 200, `${panel.name} over time`),
  limits: limits(panel), picture: panel.image ? picture(panel.image) : null,
}));
function drawPanel(panel) {
  const [g, wide, high] = fitted(panel.canvas), [low, top] = panel.limits;
  const x = (time) => LEFT + (time - shown[0]) / (shown[1] - shown[0]) * (wide - LEFT - RIGHT);
  const y = (value) => high - BOTTOM - (value - low) / (top - low) * (high - BOTTOM - TOP);
  g.save(); g.beginPath(); g.rect(LEFT, TOP, wide - LEFT - RIGHT, high - TOP - BOTTOM); g.clip();
  if (panel.picture) {
    g.imageSmoothingEnabled = false;
    const [from, to] = panel.image.time, [first, last] = panel.image.beam;
    g.drawImage(panel.picture, x(from), y(last), x(to) - x(from), y(first) - y(last));
  }
  for (const line of panel.tracks) {
    if (panel.picture) { g.save(); g.shadowColor = "#fff"; g.shadowBlur = 3; }
    stroke(g, line, (k) => x(line.time[k]), (k) => line.value[k] === null ? null : y(line.value[k]), 1.8);
    if (panel.picture) g.restore();
    g.globalAlpha = 0.18; g.fillStyle = colour(line.label);
    for (let k = 1; k < line.time.length; k++) {
      if (line.value[k] === null || line.value[k - 1] === null || !line.std[k] || (line.cut || []).includes(k)) continue;
      g.beginPath();
      g.moveTo(x(line.time[k - 1]), y(line.value[k - 1] - 2 * line.std[k - 1])); g.lineTo(x(line.time[k]), y(line.value[k] - 2 * line.std[k]));
      g.lineTo(x(line.time[k]), y(line.value[k] + 2 * line.std[k])); g.lineTo(x(line.time[k - 1]), y(line.value[k - 1] + 2 * line.std[k - 1]));
      g.fill();
    }
    g.globalAlpha = 1;
  }
  if (pointed && pointed.panel === panel) {
    g.fillStyle = colour(pointed.line.label); g.beginPath();
    g.arc(x(pointed.line.time[pointed.k]), y(pointed.line.value[pointed.k]), 4, 0, 7); g.fill();
  }
  g.restore();
  g.strokeStyle = "#999"; g.strokeRect(LEFT, TOP, wide - LEFT - RIGHT, high - TOP - BOTTOM);
  g.fillStyle = "#444"; g.textAlign = "right"; g.textBaseline = "middle";
  for (const mark of ticks(low, top, Math.max(2, high / 50))) g.fillText(String(mark), LEFT - 5, y(mark));
  g.textAlign = "center"; g.textBaseline = "top";
  for (const mark of timeTicks(shown[0], shown[1], Math.max(2, wide / 130))) {
    if (x(mark) > LEFT + 20 && x(mark) < wide - 30) g.fillText(clock(mark), x(mark), high - BOTTOM + 5);
  }
  g.save(); g.translate(11, (high - BOTTOM + TOP) / 2); g.rotate(-Math.PI / 2); g.textBaseline = "middle";
  g.fillText(panel.name.replace("_", " ") + (panel.unit ? ` (${panel.unit})` : ""), 0, 0); g.restore();
}
let world = null;
function draw() { panels.forEach(drawPanel); if (world) drawMap(); }
function say(line, k) {
  const parts = [`track ${line.label}, ${day(line.time[k])} ${clock(line.time[k])}${VIEWS.start === null ? "" : " UTC"}`];
  for (const panel of panels) {
    const same = panel.tracks.find((one) => one.label === line.label);
    if (same && same.value[k] !== null) parts.push(`${panel.name} ${+same.value[k].toPrecision(6)}${same.std[k] ? " ± " + +same.std[k].toPrecision(2) : ""} ${panel.unit}`);
  }
  said.textContent = parts.join(", ").replace(/ +/g, " ");
}
// Wheel and two fingers zoom, one finger or the mouse moves, a double click shows all.
function gestures(made, zoom, move, point, all) {
  const fingers = new Map();
  const at = (event) => { const box = made.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  made.addEventListener("wheel", (event) => { event.preventDefault(); zoom(...at(event), Math.exp(event.deltaY * 0.0015)); draw(); }, { passive: false });
  made.addEventListener("pointerdown", (event) => { fingers.set(event.pointerId, at(event)); made.setPointerCapture(event.pointerId); });
  for (const name of ["pointerup", "pointercancel"]) made.addEventListener(name, (event) => fingers.delete(event.pointerId));
  made.addEventListener("pointermove", (event) => {
    const now = at(event), before = fingers.get(event.pointerId);
    if (!before) { point(...now); draw(); return; }
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]) || 1;
      zoom((now[0] + other[0]) / 2, (now[1] + other[1]) / 2, apart(before) / apart(now));
    } else move(now[0] - before[0], now[1] - before[1]);
    fingers.set(event.pointerId, now); draw();
  });
  made.addEventListener("dblclick", () => { all(); draw(); });
}
for (const panel of panels) {
  const scale = () => (shown[1] - shown[0]) / (panel.canvas.clientWidth - LEFT - RIGHT);
  gestures(panel.canvas, (x, y, factor) => {
    const time = shown[0] + (x - LEFT) * scale();
    shown = shown.map((end) => time + (end - time) * factor);
    if (shown[1] - shown[0] > whole[1] - whole[0]) shown = whole.slice();
  }, (dx) => { shown = shown.map((end) => end - dx * scale()); }, (x, y) => {
    const time = shown[0] + (x - LEFT) * scale(), high = panel.canvas.clientHeight - TOP - BOTTOM;
    let best = Infinity; pointed = null;
    for (const line of panel.tracks) line.time.forEach((moment, k) => {
      if (line.value[k] === null) return;
      const down = TOP + high * (1 - (line.value[k] - panel.limits[0]) / (panel.limits[1] - panel.limits[0]));
      const away = Math.hypot((moment - time) / scale(), down - y);
      if (away < best && away < 30) { best = away; pointed = { panel, line, k }; }
    });
    if (pointed) say(pointed.line, pointed.k);
  }, () => { shown = whole.slice(); });
}
world = VIEWS.map && { ...VIEWS.map, canvas: canvas(520, "map of the tracks"), view: VIEWS.map.box.slice() };
function onMap(wide, high) {
  const [west, east, south, north] = world.view, middle = [(west + east) / 2, (south + north) / 2];
  const scale = Math.min((wide - 2 * LEFT) / ((east - west) * world.stretch), (high - 2 * BOTTOM) / (north - south));
  return { scale, x: (value) => wide / 2 + (value - middle[0]) * world.stretch * scale, y: (value) => high / 2 - (value - middle[1]) * scale };
}
function drawMap() {
  const [g, wide, high] = fitted(world.canvas), { scale, x, y } = onMap(wide, high);
  g.fillStyle = "#f4f7fa"; g.fillRect(0, 0, wide, high);
  g.strokeStyle = "#7a7a5c"; g.lineWidth = 1;
  for (const line of world.coast) { g.beginPath(); line.forEach(([a, b], k) => k ? g.lineTo(x(a), y(b)) : g.moveTo(x(a), y(b))); g.stroke(); }
  g.strokeStyle = "rgba(0,0,0,0.25)";
  for (const ring of world.rings) { g.beginPath(); ring.forEach(([a, b], k) => k ? g.lineTo(x(a), y(b)) : g.moveTo(x(a), y(b))); g.stroke(); }
  for (const line of world.lines) {
    stroke(g, line, (k) => line.x[k] === null ? null : x(line.x[k]), (k) => line.y[k] === null ? null : y(line.y[k]), 2);
    g.fillStyle = colour(line.label); g.fillText(String(line.label), x(line.x[0]) + 6, y(line.y[0]) - 6);
  }
  g.fillStyle = "#444"; g.textAlign = "center"; g.textBaseline = "bottom";
  const edge = (value) => world.unit === "deg" ? `${+(((value + 540) % 360) - 180).toFixed(4)}°` : `${value}`;
  const [west, east] = [0, wide].map((px) => (px - x(0)) / (world.stretch * scale)), [north, south] = [0, high].map((py) => (y(0) - py) / scale);
  for (const mark of ticks(west, east, wide / 150)) g.fillText(edge(mark), x(mark), high - 3);
  g.textAlign = "left"; g.textBaseline = "middle";
  for (const mark of ticks(south, north, high / 90)) g.fillText(world.unit === "deg" ? `${mark}°` : `${mark}`, 3, y(mark));
  // A scale bar of a round length; a degree of latitude is 111.2 km.
  const metre = world.unit === "deg" ? scale / 111195 : scale, length = ticks(0, 160 / metre, 3).pop() || 1;
  const text = length >= 1000 ? `${length / 1000} km` : `${length} m`;
  g.fillRect(wide - 20 - length * metre, 16, length * metre, 3); g.textAlign = "right"; g.fillText(text, wide - 20, 30);
}
if (world) gestures(world.canvas, (px, py, factor) => {
  const { scale, x, y } = onMap(world.canvas.clientWidth, world.canvas.clientHeight);
  const a = (px - x(0)) / (world.stretch * scale), b = (y(0) - py) / scale;
  world.view = world.view.map((end, k) => k < 2 ? a + (end - a) * factor : b + (end - b) * factor);
}, (dx, dy) => {
  const { scale } = onMap(world.canvas.clientWidth, world.canvas.clientHeight);
  world.view = world.view.map((end, k) => k < 2 ? end - dx / (scale * world.stretch) : end + dy / scale);
}, (px, py) => {
  const { x, y } = onMap(world.canvas.clientWidth, world.canvas.clientHeight);
  let best = 30, near = null;
  for (const line of world.lines) line.time.forEach((_, k) => {
    const away = line.x[k] === null ? best : Math.hypot(x(line.x[k]) - px, y(line.y[k]) - py);
    if (away < best) { best = away; near = [line, k]; }
  });
  if (near) say(...near);
}, () => { world.view = VIEWS.map.box.slice(); });
window.addEventListener("resize", draw);
draw();
