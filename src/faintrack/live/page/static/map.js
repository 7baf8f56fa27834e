// The place over time as a map: the way of each track in the stretch of time that is shown, and two deviations along both
// axes where it is now. Both axes have one scale where they have one unit.
import { MARGIN, fitted, roundStep, style, trackColour, visible } from "./drawing.js";

// What is shown: ends where they are known, and around the tracks otherwise.
function extent(shown, greeting) {
  return greeting.places.slice(0, 2).map(({ name, ends }) => {
    if (ends) return [Math.min(...ends), Math.max(...ends)];
    let low = Infinity, high = -Infinity;
    for (const [, scan] of shown) {
      for (const track of scan.tracks) {
        if (track[name] === null) continue;
        const around = 2 * (track[`${name}_std`] || 0);
        low = Math.min(low, track[name] - around); high = Math.max(high, track[name] + around);
      }
    }
    const around = 0.15 * (high - low) || 1;
    return low > high ? [-1, 1] : [low - around, high + around];
  });
}

// From places to the canvas: its left lower corner, and pixels a unit along both axes.
function frameOf(canvas, shown, greeting) {
  const wide = canvas.clientWidth - MARGIN.left - 8, high = canvas.clientHeight - MARGIN.top - MARGIN.bottom;
  const [[left, right], [bottom, top]] = extent(shown, greeting);
  const scale = Math.min(wide / (right - left), high / (top - bottom));
  const spareX = (wide / scale - (right - left)) / 2, spareY = (high / scale - (top - bottom)) / 2;
  // The first row of an image is at the top.
  const down = greeting.places[1].unit === "pixel";
  return { left: left - spareX, bottom: bottom - spareY, top: top + spareY, down, scale, wide, high };
}

function heightOf(value, f) {
  return MARGIN.top + (f.down ? value - f.bottom : f.top - value) * f.scale;
}

export function placeAt(px, py, canvas, scans, view, greeting) {
  const f = frameOf(canvas, visible(scans, view), greeting);
  return [f.left + (px - MARGIN.left) / f.scale, f.down ? f.bottom + (py - MARGIN.top) / f.scale : f.top - (py - MARGIN.top) / f.scale];
}

function axes(g, f, greeting) {
  const step = roundStep(Math.max(f.wide, f.high) / f.scale / 8);
  const [across, up] = greeting.places;
  g.font = "12px system-ui, sans-serif"; g.fillStyle = style("--faint"); g.strokeStyle = style("--line"); g.lineWidth = 1;
  g.textAlign = "center"; g.textBaseline = "top";
  for (let x = Math.ceil(f.left / step) * step; x <= f.left + f.wide / f.scale; x += step) {
    const px = MARGIN.left + (x - f.left) * f.scale;
    g.beginPath(); g.moveTo(px, MARGIN.top); g.lineTo(px, MARGIN.top + f.high); g.stroke();
    if (px < MARGIN.left + f.wide - 60) g.fillText(String(+x.toPrecision(6)), px, MARGIN.top + f.high + 6);
  }
  g.textAlign = "right"; g.fillText(title(across), MARGIN.left + f.wide, MARGIN.top + f.high + 6);
  g.textBaseline = "middle";
  for (let y = Math.ceil(f.bottom / step) * step; y <= f.bottom + f.high / f.scale; y += step) {
    const py = heightOf(y, f);
    g.beginPath(); g.moveTo(MARGIN.left, py); g.lineTo(MARGIN.left + f.wide, py); g.stroke();
    if (py > MARGIN.top + 20) g.fillText(String(+y.toPrecision(6)), MARGIN.left - 6, py);
  }
  g.textBaseline = "top"; g.fillText(title(up), MARGIN.left - 6, MARGIN.top);
}

function title({ name, unit }) { return unit === "m" ? name.replace("_", " (") + ")" : `${name} (${unit})`; }

export function drawMap(canvas, scans, view, greeting, chosen, night) {
  const [g, width] = fitted(canvas);
  if (width < MARGIN.left + 20) return;
  const shown = visible(scans, view), f = frameOf(canvas, shown, greeting);
  axes(g, f, greeting);
  const [across, up] = greeting.places.map((place) => place.name);
  const x = (track) => MARGIN.left + (track[across] - f.left) * f.scale;
  const y = (track) => heightOf(track[up], f);
  const ways = new Map();
  for (const [, scan] of shown) {
    for (const track of scan.tracks) {
      if (track[across] === null || track[up] === null) continue;
      if (!ways.has(track.label)) ways.set(track.label, []);
      ways.get(track.label).push(track);
    }
  }
  const now = new Set(shown.length ? shown[0][1].tracks.map((track) => track.label) : []);
  g.save();
  g.beginPath(); g.rect(MARGIN.left, MARGIN.top, f.wide, f.high); g.clip();
  for (const [label, way] of ways) {
    const colour = trackColour(label, night), [last] = way, thick = label === chosen ? 4 : 2;
    // What is gone is fainter than what is in hand.
    g.globalAlpha = now.has(label) ? 1 : 0.45;
    g.beginPath();
    way.forEach((track, k) => (k ? g.lineTo(x(track), y(track)) : g.moveTo(x(track), y(track))));
    g.strokeStyle = style("--panel"); g.lineWidth = thick + 2; g.stroke();
    g.strokeStyle = colour; g.lineWidth = thick; g.stroke();
    const wide = 2 * (last[`${across}_std`] || 0) * f.scale, high = 2 * (last[`${up}_std`] || 0) * f.scale;
    g.beginPath();
    g.moveTo(x(last) - wide, y(last)); g.lineTo(x(last) + wide, y(last));
    g.moveTo(x(last), y(last) - high); g.lineTo(x(last), y(last) + high);
    g.lineWidth = 1.5; g.stroke();
    g.beginPath(); g.arc(x(last), y(last), thick + 2, 0, 2 * Math.PI); g.fillStyle = colour; g.fill();
    g.font = "bold 13px system-ui, sans-serif"; g.textAlign = "left"; g.textBaseline = "bottom";
    g.lineWidth = 3; g.strokeStyle = style("--panel");
    g.strokeText(String(label), x(last) + 8, y(last) - 6); g.fillText(String(label), x(last) + 8, y(last) - 6);
  }
  g.restore();
}
