// Pictures of scans on canvases, newest on top. A view is what part of the scans is shown: `offset` scans are newer than it,
// and it is `rows` scans high.

export const MARGIN = { left: 66, bottom: 24, top: 6 };
const TRACKS_DAY = ["#d55e00", "#000000", "#0072b2", "#cc79a7", "#e69f00", "#009e73"];
const TRACKS_NIGHT = ["#ffd9a0", "#ffffff", "#ff8a5c", "#ffb3c8", "#ffe36e", "#c9ffb0"];
// Lightness rises evenly in both, so that they read without colours too.
const DAY = [[255, 255, 255], [214, 226, 240], [150, 186, 218], [84, 140, 190], [30, 84, 140], [8, 29, 88]];
const NIGHT = [[8, 3, 3], [46, 12, 8], [98, 26, 14], [160, 52, 26], [214, 98, 52], [255, 190, 140]];

function table(anchors) {
  const colours = new Uint32Array(256);
  for (let level = 0; level < 256; level++) {
    const place = (level / 255) * (anchors.length - 1);
    const low = Math.min(Math.floor(place), anchors.length - 2);
    const [r, g, b] = anchors[low].map((value, k) => value + (anchors[low + 1][k] - value) * (place - low));
    colours[level] = (255 << 24) | (Math.round(b) << 16) | (Math.round(g) << 8) | Math.round(r);
  }
  return colours;
}
const COLOURS = { day: table(DAY), night: table(NIGHT) };

export function trackColour(label, night) {
  const colours = night ? TRACKS_NIGHT : TRACKS_DAY;
  return colours[(label - 1) % colours.length];
}

export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  return [g, canvas.clientWidth, canvas.clientHeight];
}

export function style(name) { return getComputedStyle(document.documentElement).getPropertyValue(name); }

// Scans of a view, newest first, each with the number of its row: time that was passed over is rows without a scan.
export function visible(scans, view) {
  const shown = [];
  const last = scans.length ? scans[scans.length - 1].scan - view.offset : 0;
  for (let k = scans.length - 1; k >= 0; k--) {
    const row = last - scans[k].scan;
    if (row >= view.rows) break;
    if (row >= 0) shown.push([row, scans[k]]);
  }
  return shown;
}

// Range of levels that colours span: from the median of the quiet to the loudest, of a sample of what is shown.
function range(shown) {
  const levels = [];
  for (let k = 0; k < shown.length; k += Math.max(1, Math.floor(shown.length / 40))) {
    const scan = shown[k][1];
    for (let beam = 0; beam < scan.row.length; beam += 3) {
      levels.push(scan.low_db + (scan.row[beam] / 255) * (scan.high_db - scan.low_db));
    }
  }
  levels.sort((a, b) => a - b);
  if (!levels.length) return [0, 1];
  const low = levels[Math.floor(0.3 * (levels.length - 1))], high = levels[levels.length - 1];
  return [low, Math.max(high, low + 3)];
}

const picture = document.createElement("canvas");

export function bearingAt(x, width, [first, last]) {
  return first + ((x - MARGIN.left) / Math.max(1, width - MARGIN.left)) * (last - first);
}

// Ends of the place across the picture: as they are known, or around what the tracks have.
export function endsOf(scans, view, greeting) {
  const place = greeting.places[0];
  if (place.ends) return place.ends;
  let low = Infinity, high = -Infinity;
  for (const [, scan] of visible(scans, view)) {
    for (const track of scan.tracks) {
      if (track[place.name] === null) continue;
      low = Math.min(low, track[place.name]); high = Math.max(high, track[place.name]);
    }
  }
  if (low > high) return [0, 1];
  const around = 0.1 * (high - low) || 1;
  return [low - around, high + around];
}

// A round number near a value.
export function roundStep(value) {
  const power = 10 ** Math.floor(Math.log10(value)), share = value / power;
  return (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10) * power;
}

export function rowAt(y, height, view) {
  return Math.floor(((y - MARGIN.top) / (height - MARGIN.top - MARGIN.bottom)) * view.rows);
}

export function drawRecord(canvas, scans, view, greeting, chosen, night) {
  const [g, width, height] = fitted(canvas);
  const wide = width - MARGIN.left, high = height - MARGIN.top - MARGIN.bottom;
  if (!greeting || !scans.length || wide < 10) return;
  const shown = visible(scans, view);
  const beams = scans[scans.length - 1].row.length;
  if (beams) drawLevels(g, shown, beams, view, wide, high, night);
  const [first, last] = endsOf(scans, view, greeting), degrees = greeting.places[0].unit === "degree";
  const x = (deg) => MARGIN.left + ((deg - first) / (last - first)) * wide;
  const y = (row) => MARGIN.top + ((row + 0.5) / view.rows) * high;
  drawTracks(g, shown, greeting.places[0].name, x, y, chosen, night, degrees ? Math.abs(last - first) : Infinity);
  g.fillStyle = style("--faint"); g.strokeStyle = style("--line"); g.font = "12px system-ui, sans-serif"; g.lineWidth = 1;
  g.textBaseline = "top";
  const step = !degrees ? roundStep(Math.abs(last - first) / (wide > 500 ? 8 : 4)) : Math.abs(last - first) > 200 ? (wide > 500 ? 45 : 90) : (wide > 500 ? 20 : wide > 220 ? 45 : 90);
  for (let deg = Math.ceil(Math.min(first, last) / step) * step; deg <= Math.max(first, last) + 0.01; deg += step) {
    const place = x(deg);
    g.textAlign = place > width - 20 ? "right" : place < MARGIN.left + 14 ? "left" : "center";
    g.fillText(degrees ? deg + "°" : String(+deg.toPrecision(6)), place, height - MARGIN.bottom + 6);
    g.beginPath(); g.moveTo(place, height - MARGIN.bottom); g.lineTo(place, height - MARGIN.bottom + 4); g.stroke();
  }
  g.textAlign = "right"; g.textBaseline = "middle";
  const newest = scans[scans.length - 1].time - view.offset * greeting.scan_interval;
  const lines = Math.max(2, Math.floor(high / 70));
  for (let k = 0; k <= lines; k++) {
    const row = (k / lines) * (view.rows - 1);
    const time = newest - row * greeting.scan_interval;
    if (time >= 0) g.fillText(clock(time, greeting), MARGIN.left - 6, Math.min(y(row), height - MARGIN.bottom - 6) + 2);
  }
}

function drawLevels(g, shown, beams, view, wide, high, night) {
  picture.width = beams; picture.height = view.rows;
  const p = picture.getContext("2d");
  const image = p.createImageData(beams, view.rows);
  const pixels = new Uint32Array(image.data.buffer);
  const [low, top] = range(shown);
  const colours = night ? COLOURS.night : COLOURS.day;
  for (const [row, scan] of shown) {
    if (scan.row.length !== beams) continue;
    const scale = ((scan.high_db - scan.low_db) / (top - low)) , shift = ((scan.low_db - low) / (top - low)) * 255;
    for (let beam = 0; beam < beams; beam++) {
      const level = shift + scan.row[beam] * scale;
      pixels[row * beams + beam] = colours[level < 0 ? 0 : level > 255 ? 255 : level | 0];
    }
  }
  p.putImageData(image, 0, 0);
  g.imageSmoothingEnabled = false;
  g.drawImage(picture, MARGIN.left, MARGIN.top, wide, high);
}

// Mean of each track, and two deviations on either side; a bearing that passes the edge begins a new line.
function drawTracks(g, shown, name, x, y, chosen, night, around) {
  const tracks = new Map();
  for (const [row, scan] of shown) {
    for (const track of scan.tracks) {
      if (track[name] === null) continue;
      if (!tracks.has(track.label)) tracks.set(track.label, []);
      tracks.get(track.label).push([row, track[name], track[`${name}_std`] || 0]);
    }
  }
  for (const [label, points] of tracks) {
    const colour = trackColour(label, night);
    const lines = [];
    for (const point of points) {
      const line = lines[lines.length - 1], before = line && line[line.length - 1];
      if (before && point[0] - before[0] < 60 && Math.abs(point[1] - before[1]) < around / 2) line.push(point);
      else lines.push([point]);
    }
    for (const line of lines) {
      g.fillStyle = colour; g.globalAlpha = 0.25;
      g.beginPath();
      line.forEach(([row, deg, std], k) => (k ? g.lineTo(x(deg - 2 * std), y(row)) : g.moveTo(x(deg - 2 * std), y(row))));
      for (let k = line.length - 1; k >= 0; k--) g.lineTo(x(line[k][1] + 2 * line[k][2]), y(line[k][0]));
      g.closePath(); g.fill();
      g.globalAlpha = 1;
      g.beginPath();
      line.forEach(([row, deg], k) => (k ? g.lineTo(x(deg), y(row)) : g.moveTo(x(deg), y(row))));
      // A line is seen on a loud source too.
      const thick = label === chosen ? 4 : 2;
      g.strokeStyle = style("--panel"); g.lineWidth = thick + 2; g.stroke();
      g.strokeStyle = colour; g.lineWidth = thick; g.stroke();
    }
    const [row, deg] = points[0];
    g.font = "bold 13px system-ui, sans-serif"; g.textAlign = "left"; g.textBaseline = "top";
    g.lineWidth = 3; g.strokeStyle = style("--panel"); g.fillStyle = colour;
    g.strokeText(String(label), x(deg) + 7, y(row) + 1); g.fillText(String(label), x(deg) + 7, y(row) + 1);
  }
}

// Existence beside the record, on the same time; the thresholds at which tracks begin and end are lines.
export function drawExistence(canvas, scans, view, greeting, chosen, night) {
  const [g, width, height] = fitted(canvas);
  if (!greeting || !scans.length) return;
  const high = height - MARGIN.top - MARGIN.bottom, left = 8, wide = width - 2 * left;
  const x = (value) => left + value * wide, y = (row) => MARGIN.top + ((row + 0.5) / view.rows) * high;
  g.font = "12px system-ui, sans-serif"; g.textBaseline = "top"; g.fillStyle = style("--faint");
  g.strokeStyle = style("--line"); g.strokeRect(left, MARGIN.top, wide, high);
  g.textAlign = "left"; g.fillText("0", left, height - MARGIN.bottom + 6);
  g.textAlign = "center";
  if (width > 110) g.fillText("existence", width / 2, height - MARGIN.bottom + 6);
  g.textAlign = "right"; g.fillText("1", width - left, height - MARGIN.bottom + 6);
  for (const [value, dash] of [[greeting.declare, [6, 3]], [greeting.drop, [2, 3]]]) {
    g.setLineDash(dash); g.strokeStyle = style("--faint");
    g.beginPath(); g.moveTo(x(value), MARGIN.top); g.lineTo(x(value), MARGIN.top + high); g.stroke();
  }
  g.setLineDash([]);
  const lines = new Map([[0, []]]);
  for (const [row, scan] of visible(scans, view)) {
    // What is not declared yet: the largest existence of all.
    lines.get(0).push([row, scan.existence]);
    for (const track of scan.tracks) {
      if (!lines.has(track.label)) lines.set(track.label, []);
      lines.get(track.label).push([row, track.existence]);
    }
  }
  for (const [label, points] of lines) {
    g.strokeStyle = label ? trackColour(label, night) : style("--faint");
    g.lineWidth = label === 0 ? 1 : label === chosen ? 4 : 2;
    g.beginPath();
    points.forEach(([row, value], k) =>
      k && row - points[k - 1][0] < 60 ? g.lineTo(x(value), y(row)) : g.moveTo(x(value), y(row)));
    g.stroke();
  }
}

export function clock(time, greeting) {
  if (greeting.start_time) {
    const begun = Date.parse(greeting.start_time.slice(0, 23).replace(/Z?$/, "Z"));
    if (!Number.isNaN(begun)) return new Date(begun + 1000 * time).toISOString().slice(11, 19);
  }
  const whole = Math.floor(time), two = (value) => String(value).padStart(2, "0");
  return `${two(Math.floor(whole / 3600))}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}
