// Panels over time, and panels over something else, as Plotly traces and layouts.
const symbols = { used: "circle", reset: "star", rejected: "x-thin-open", withheld: "diamond-open", late: "triangle-up-open", unused: "circle-open" };
const glyphs = { reset: "★", rejected: "✕", withheld: "◇", late: "△", unused: "○" };
const marks = new Set(["rejected", "withheld", "reset", "late", "unused"]);

// Nearly all of a band or a gate: what it is at its widest, in the first seconds, would squash the rest.
function reachOf(curve, range, share = 0.97) {
  const first = Math.max(lowerBound(curve.x, range[0]) - 1, 0), last = lowerBound(curve.x, range[1]) + 1;
  const sorted = (curve.y2 || curve.y).slice(first, last).map(Math.abs).filter(Number.isFinite).sort();
  return sorted.length ? 1.1 * sorted[Math.floor(share * (sorted.length - 1))] : 0;
}

function extent(curve, range) {
  let first = lowerBound(curve.x, range[0]), last = lowerBound(curve.x, range[1]);
  if (curve.kind !== "points") { first = Math.max(first - 1, 0); last = Math.min(last + 1, curve.x.length); }
  else while (last < curve.x.length && curve.x[last] <= range[1]) last++;
  let low = Infinity, high = -Infinity;
  for (let i = first; i < last; i++) {
    const y = curve.y[i], top = curve.y2 ? curve.y2[i] : y;
    if (y < low) low = y;
    if (top > high) high = top;
  }
  return [low, high];
}

// The lines and the used points set the range; bands, gates and rejected points widen it up to four times at most.
function yRange(row, range, hidden) {
  if (row.range) return row.range;
  let low = Infinity, high = -Infinity, wideLow = Infinity, wideHigh = -Infinity, usual = 0;
  for (const curve of row.curves) {
    if (hidden.has(curve.name)) continue;
    const envelope = curve.kind === "band" || (curve.role === "gate" && !row.log);
    const [a, b] = row.zero && envelope ? [-1, 1].map((sign) => sign * reachOf(curve, range)) : extent(curve, range);
    usual = curve.kind === "points" ? Infinity : Math.max(usual, envelope ? b : reachOf(curve, range, 0.95));
    if (envelope || (curve.role === "rejected" && !row.log)) { wideLow = Math.min(wideLow, a); wideHigh = Math.max(wideHigh, b); }
    else { low = Math.min(low, a); high = Math.max(high, b); }
  }
  // A few spikes of a line do not hide its band: they leave the picture, and the note says so.
  if (row.zero && usual > 0 && Math.max(-low, high) > 3 * usual) { low = -usual; high = usual; }
  if (low > high) { low = wideLow; high = wideHigh; }
  if (low > high) return [-1, 1];
  if (row.log) {
    if (wideLow < wideHigh) { low = Math.min(low, Math.max(wideLow, low / 3)); high = Math.max(high, Math.min(wideHigh, 3 * high)); }
    const b = Math.log10(Math.max(high, 1e-12)), least = Math.min(row.floor ? Math.log10(row.floor) : b - 9, b - 1);
    const a = Math.max(Math.log10(Math.max(low, 1e-12)), least), pad = Math.max(0.06 * (b - a), 0.5 * (0.5 - (b - a)), 0.05);
    return [a - pad, b + pad];
  }
  const reach = row.zero ? 4 * Math.max(Math.abs(low), Math.abs(high), 1e-12) : 4 * Math.max(high - low, 1e-12);
  if (wideLow < wideHigh) { low = Math.min(low, Math.max(wideLow, low - reach)); high = Math.max(high, Math.min(wideHigh, high + reach)); }
  if (row.zero) { const top = Math.max(Math.abs(low), Math.abs(high)); low = -top; high = top; }
  if (row.curves.some((curve) => curve.kind === "steps")) return [0, 1.06 * high];
  const size = Math.max(Math.abs(low), Math.abs(high)), flat = high - low <= 1e-7 * size;
  const pad = flat ? 0.1 * size || 1 : 0.06 * (high - low);
  return [low - pad, high + pad];
}

function xRange(panel) {
  if (panel.x.range) return panel.x.range.map((x) => (panel.x.log ? Math.log10(x) : x));
  let low = Infinity, high = -Infinity;
  for (const row of panel.rows) for (const curve of row.curves) for (const x of curve.x)
    if (!panel.x.log || x > 0) { low = Math.min(low, x); high = Math.max(high, x); }
  if (!(low < high)) { high = low > 0 ? 2 * low : low + 1; low = low > 0 ? low / 2 : low - 1; }
  return panel.x.log ? [Math.log10(low), Math.log10(high)] : [low, high];
}

function frame() {
  const axis = { color: color("soft"), gridcolor: color("grid"), linecolor: color("line"), zerolinecolor: color("line"), zeroline: false };
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, autosize: true,
    font: { family: "system-ui, sans-serif", size: 12, color: color("ink") },
    hoverlabel: { bgcolor: color("card"), bordercolor: color("line"), font: { color: color("ink") } },
    axis,
  };
}
const config = { responsive: true, displaylogo: false, showTips: false, displayModeBar: false };

function trace(curve, axis, unit, hidden, shift) {
  const c = color(curve.role), visible = !hidden.has(curve.name), x = shift ? curve.x.map((time) => time + shift) : curve.x;
  const base = { type: "scatter", name: safe(curve.name), yaxis: axis, visible, x };
  const label = `%{y:.4g} ${unit === "1" ? "" : safe(unit)}`;
  if (curve.kind === "band") {
    const edge = { mode: "lines", line: { width: 0 }, hoverinfo: "skip" };
    return [{ ...base, ...edge, y: curve.y }, { ...base, ...edge, y: curve.y2, fill: "tonexty", fillcolor: c + "2e" }];
  }
  if (curve.kind === "points") {
    const marked = marks.has(curve.role), size = { reset: 10, rejected: 7, late: 7, withheld: 4.5 }[curve.role] || 4;
    const line = { color: c, width: curve.role === "rejected" ? 1.5 : marked && curve.role !== "reset" ? 1 : 0 };
    return [{ ...base, mode: "markers", y: curve.y, hovertemplate: label, marker: { color: c, symbol: symbols[curve.role] || "circle", size, line } }];
  }
  const shape = curve.kind === "steps" ? "hvh" : "linear", mode = curve.markers ? "lines+markers" : "lines";
  const line = { color: c, width: curve.role === "outage" ? 13 : dashes[curve.role] ? 1.3 : 1.5, dash: curve.dash || dashes[curve.role] || "solid", shape };
  return [{ ...base, mode, y: curve.y, hovertemplate: label, line, marker: { size: 4 }, ...(curve.role === "outage" ? { opacity: 0.4 } : {}) }];
}

function logTicks([a, b]) {
  const width = b - a, step = Math.max(1, Math.ceil(width / 5));
  const heads = width > 3 ? [1] : width > 1.6 ? [1, 3] : width > 0.9 ? [1, 2, 5] : [1, 1.5, 2, 3, 5, 7];
  const tickvals = [];
  for (let power = step * Math.floor(a / step); power <= b; power += step)
    for (const head of heads) {
      const place = power + Math.log10(head);
      if (place >= a && place <= b) tickvals.push(head * 10 ** power);
    }
  return { tickmode: "array", tickvals, ticktext: tickvals.map((value) => String(Number(value.toPrecision(2)))) };
}

function figure(plot) {
  const { axis, ...layout } = frame(), { panel } = plot, { rows } = panel, gap = 0.22 / Math.max(rows.length * 2, 3), traces = [];
  const height = (1 - gap * (rows.length - 1)) / rows.length, overTime = !panel.x, shift = overTime ? state.shift : 0;
  const window = overTime ? state.span : [-Infinity, Infinity];
  rows.forEach((row, i) => {
    const suffix = i ? String(i + 1) : "", top = 1 - i * (height + gap), range = yRange(row, window, plot.hidden);
    layout[`yaxis${suffix}`] = {
      ...axis, domain: [Math.max(top - height, 0), top], type: row.log ? "log" : "linear", fixedrange: true, range,
      title: { text: `${safe(row.label)} [${safe(row.unit)}]`, font: { size: 12 }, standoff: 6 }, nticks: 5, zeroline: row.zero, exponentformat: "power",
      ...(row.log ? logTicks(range) : {}),
    };
    for (const curve of row.curves) traces.push(...trace(curve, `y${suffix}`, row.unit, plot.hidden, shift));
  });
  layout.margin = { l: 66, r: 14, t: 8, b: overTime && state.data.clock ? 62 : 46 };
  layout.hovermode = "x unified";
  layout.dragmode = coarse ? false : "zoom";
  const anchor = rows.length > 1 ? `y${rows.length}` : "y";
  if (overTime) {
    const drawn = state.span.map((time) => time + shift);
    layout.xaxis = {
      ...axis, anchor, range: drawn, title: { text: timeTitle(plot.box.clientWidth), standoff: 6 }, hoverformat: ".2f", ...timeTicks(state.span, plot.box.clientWidth - 80),
    };
    layout.shapes = state.data.shading.map(([a, b]) => ({ type: "rect", xref: "x", yref: "paper", x0: a + state.data.start + shift, x1: b + state.data.start + shift,
      y0: 0, y1: 1, layer: "below", line: { width: 0 }, fillcolor: color("shade") }));
  } else {
    const range = xRange(panel), { label, unit, log } = panel.x;
    layout.xaxis = {
      ...axis, anchor, type: log ? "log" : "linear", range, title: { text: `${safe(label)} [${safe(unit)}]`, standoff: 6 }, fixedrange: coarse, hoverformat: ".4g",
      exponentformat: "power", ...(log && range[1] - range[0] < 6 ? logTicks(range) : {}),
    };
    layout.uirevision = "kept";
  }
  return [traces, layout];
}
