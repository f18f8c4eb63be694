// The map: tracks and fixes to scale, the stretch of time shown, and its own zoom.
let map;

function mapFigure() {
  const { axis, ...layout } = frame(), traces = [], { hidden, best } = map, { data, span, full } = state;
  const where = "%{x:.2f} m east<br>%{y:.2f} m north<br>log time %{customdata:.2f} s";
  for (const curve of [...data.map.tracks.filter((one) => one.role === "outage"), ...data.map.clouds, ...data.map.tracks.filter((one) => one.role !== "outage")]) {
    const { x, ...base } = trace({ ...curve, x: curve.e }, "y", "m", hidden, 0)[0];
    if (curve.kind === "points") base.opacity = curve.x.length > 500 ? 0.45 : 0.8;
    else if (curve.role !== "outage") base.line = { ...base.line, width: 2.2 };
    traces.push({ ...base, x, customdata: curve.x, hovertemplate: where });
  }
  const zoomed = span[0] > full[0] || span[1] < full[1], first = lowerBound(best.x, span[0]), last = lowerBound(best.x, span[1]) + 1;
  traces.push({ type: "scatter", mode: "lines", x: best.e.slice(first, last), y: best.y.slice(first, last), hoverinfo: "skip", visible: zoomed,
    name: "time shown", line: { color: color("check"), width: 6 }, opacity: 0.55 });
  traces.push({ type: "scatter", mode: "markers", x: [best.e[0]], y: [best.y[0]], name: "start", customdata: [best.x[0]], hovertemplate: "start",
    marker: { size: 13, symbol: "star", color: color("ink"), line: { color: color("paper"), width: 1 } } });
  const [west, east, south, north] = data.map.view, exponentformat = "none", nticks = map.box.clientWidth < 500 ? 5 : 9;
  layout.xaxis = { ...axis, range: [west, east], title: { text: "east of the start [m]", standoff: 6 }, exponentformat, nticks };
  layout.yaxis = { ...axis, range: [south, north], title: { text: "north of the start [m]" }, scaleanchor: "x", scaleratio: 1, exponentformat };
  layout.margin = { l: 68, r: 12, t: 8, b: 48 };
  layout.hovermode = "closest";
  layout.dragmode = coarse ? false : "pan";
  layout.uirevision = "map";
  return [traces, layout];
}

function zoomMap(factor) {
  if (!map.drawn) return;
  const { xaxis, yaxis } = map.box._fullLayout, [west, east, south, north] = state.data.map.view;
  const around = ({ range: [a, b] }) => [0.5 * (a + b) - (0.5 * (b - a)) / factor, 0.5 * (a + b) + (0.5 * (b - a)) / factor];
  const ranges = factor ? { "xaxis.range": around(xaxis), "yaxis.range": around(yaxis) } : { "xaxis.range": [west, east], "yaxis.range": [south, north] };
  Plotly.relayout(map.box, ranges).then(() => cursor(state.time));
}

function mapButtons(line) {
  for (const [text, name, factor] of [["+", "Zoom the map in", 1.6], ["−", "Zoom the map out", 1 / 1.6], ["Whole track", "", 0]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "tool";
    button.textContent = text;
    if (name) button.setAttribute("aria-label", name);
    button.addEventListener("click", () => zoomMap(factor));
    line.append(button);
  }
}
