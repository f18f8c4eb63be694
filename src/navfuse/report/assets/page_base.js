// What the rest stands on: the page's state, the arrays that Python packed, colours and times.
const byId = (id) => document.getElementById(id);
const state = { data: null, full: [0, 1], span: [0, 1], time: null, shift: 0 };
const plots = new Map();
const coarse = matchMedia("(pointer: coarse)").matches;
const dashes = { truth: "dot", guide: "dot", gate: "dash" };
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const color = (role) => css(`--${role}`) || css("--unused");
const safe = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

function bytes(id) {
  const raw = atob(byId(id).textContent.trim()), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}
const inflate = (id) => new Response(new Blob([bytes(id)]).stream().pipeThrough(new DecompressionStream("gzip")));

function unpack(entry, block) {
  const { at, n, planes } = entry, words = new Uint32Array(n), out = new Float64Array(n);
  for (let k = 0; k < planes; k++)
    for (let i = 0, from = at + k * n, shift = 24 - 8 * k; i < n; i++) words[i] |= block[from + i] << shift;
  if (entry.step === undefined) return Float64Array.from(new Float32Array(words.buffer));
  const ticks = new Int32Array(words.buffer);
  for (let i = 0, sum = 0; i < n; i++) { sum += ticks[i]; out[i] = entry.first + entry.step * sum; }
  return out;
}

function decode(curve, block, start) {
  for (const key of ["x", "y", "y2", "e"]) if (curve[key] !== undefined) curve[key] = unpack(curve[key], block);
  if (curve.y === undefined) curve.y = curve.y2.map((value) => -value);
  if (start) for (let i = 0; i < curve.x.length; i++) curve.x[i] += start;
}

function lowerBound(x, value) {
  let low = 0, high = x.length;
  while (low < high) { const mid = (low + high) >> 1; if (x[mid] < value) low = mid + 1; else high = mid; }
  return low;
}

function valueAt(x, y, at) {
  const i = Math.min(Math.max(lowerBound(x, at), 1), x.length - 1);
  if (x.length < 2 || at <= x[0]) return y[0];
  const share = Math.min((at - x[i - 1]) / (x[i] - x[i - 1] || 1), 1), value = y[i - 1] + share * (y[i] - y[i - 1]);
  return Number.isNaN(value) ? y[i] : value;
}

const utc = (time) => {
  let unix = state.data.clock.unix[0][1];
  for (const [from, base] of state.data.clock.unix) if (time >= from) unix = base;
  return unix + time;
};

function clockText(time, decimals) {
  const scale = 10 ** decimals, ms = (Math.round(utc(time) * scale) / scale) * 1000;
  return new Date(ms + 1e-4).toISOString().slice(11, decimals ? 20 + decimals : 19);
}
const dateText = (time) => new Date(utc(time) * 1000).toISOString().slice(0, 10);

function timeText(time) {
  const { clock } = state.data, log = `${time.toFixed(2)} s`;
  if (!clock) return log;
  const gps = `GPS week ${clock.week} ${(time + clock.tow).toFixed(2)} s`;
  return `log ${log} · ${gps} · ${clockText(time, 1)} UTC`;
}

const sexagesimal = [10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];
function niceStep(raw, clock) {
  if (clock && raw > 5) return sexagesimal.find((step) => step >= 0.7 * raw) || 86400 * Math.ceil(raw / 86400);
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((head) => head * power).find((step) => step >= raw * 0.999);
}

// Ticks at round clock times where there is a clock, else at round log times; places are those of the drawn axis.
function timeTicks([a, b], width) {
  const { clock } = state.data, step = niceStep((b - a) / Math.max(2, Math.floor(width / 90)), clock);
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)), zero = clock ? utc(a) - a : state.shift;
  const tickvals = [], ticktext = [], days = clock && dateText(a) !== dateText(b);
  for (let tick = step * Math.ceil((a + zero) / step - 1e-9); tick - zero <= b + 1e-9; tick += step) {
    const time = tick - zero, day = days ? `<br>${dateText(time).slice(5)}` : "";
    tickvals.push(time + state.shift);
    ticktext.push((time + state.shift).toFixed(decimals) + (clock ? `<br>${clockText(time, decimals)}${day}` : ""));
  }
  return { tickmode: "array", tickvals, ticktext };
}

function timeTitle(width) {
  const { clock } = state.data, { shift } = state, scale = !clock || (clock.tow && !shift) ? "log time [s]" : `GPS time of week ${clock.week} [s]`;
  return !clock ? scale : width < 500 ? `${scale}, UTC` : `${scale}, clock UTC on ${dateText(state.span[0])}`;
}
