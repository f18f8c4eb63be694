// The window of time that all plots share, and the cursor in it: by mouse, by keys, by the fields above the plots.
function draw(plot) {
  const [traces, layout] = plot.panel ? figure(plot) : mapFigure();
  Plotly.react(plot.box, traces, layout, config);
  plot.seen = state.span;
  plot.width = plot.box.clientWidth;
  if (plot.drawn) return;
  plot.drawn = true;
  plot.box.dataset.drawn = "yes";
  if (plot.panel && plot.panel.x) return;
  plot.box.on("plotly_hover", (event) => cursor(plot.panel ? event.points[0].x - state.shift : event.points[0].customdata));
  if (!plot.panel) {
    plot.box.on("plotly_relayout", () => cursor(state.time));
    return;
  }
  plot.box.on("plotly_relayout", (change) => {
    if (change["xaxis.autorange"]) show([...state.full]);
    else if (change["xaxis.range[0]"] !== undefined) show([change["xaxis.range[0]"] - state.shift, change["xaxis.range[1]"] - state.shift]);
    else if (change["xaxis.range"]) show(change["xaxis.range"].map((time) => time - state.shift));
  });
  plot.box.on("plotly_doubleclick", () => { show([...state.full]); return false; });
}

const follows = (plot) => !plot.panel || !plot.panel.x;
const stale = (plot) => (follows(plot) && plot.seen !== state.span) || plot.width !== plot.box.clientWidth;

function refresh() {
  for (const plot of plots.values()) if (plot.drawn && plot.visible && stale(plot)) draw(plot);
  cursor(state.time);
}

function fields() {
  byId("from").value = (state.span[0] + state.shift).toFixed(2);
  byId("to").value = (state.span[1] + state.shift).toFixed(2);
}

function show(range) {
  const { full, span } = state, from = Math.max(Number(range[0]), full[0]), to = Math.min(Number(range[1]), full[1]);
  if (!(to > from) || (from === span[0] && to === span[1])) { fields(); return; }
  state.span = [from, to];
  fields();
  refresh();
}

// Zooming about the cursor; a window that would reach beyond the run is moved inside it.
function zoom(factor) {
  const [a, b] = state.span, [low, high] = state.full, t = state.time, around = t !== null && t >= a && t <= b ? t : 0.5 * (a + b);
  const length = Math.min((b - a) / factor, high - low), from = Math.min(Math.max(around - (around - a) / factor, low), high - length);
  if (length > 0.05) show([from, from + length]);
}

function pan(share) {
  const [a, b] = state.span, [low, high] = state.full, by = Math.min(Math.max(share * (b - a), low - a), high - b);
  show([a + by, b + by]);
}

function cursor(time) {
  state.time = time;
  const [a, b] = state.span, slider = byId("cursor"), text = time === null ? "" : timeText(time);
  byId("readout").textContent = text;
  slider.value = String(time === null ? 0 : (1000 * (time - a)) / (b - a));
  slider.setAttribute("aria-valuetext", text || "no cursor");
  for (const plot of plots.values()) {
    if (!plot.drawn || !plot.visible || !follows(plot)) continue;
    const layout = plot.box._fullLayout, { mark } = plot;
    mark.hidden = time === null || (plot.panel && (time < a || time > b));
    if (mark.hidden) continue;
    if (plot.panel) {
      mark.style.left = `${layout.xaxis._offset + layout.xaxis.d2p(time + state.shift)}px`;
      mark.style.height = `${layout._size.t + layout._size.h}px`;
    } else {
      const { best } = plot, east = layout.xaxis.d2p(valueAt(best.x, best.e, time)), north = layout.yaxis.d2p(valueAt(best.x, best.y, time));
      mark.hidden = !(east >= 0 && east <= layout.xaxis._length && north >= 0 && north <= layout.yaxis._length);
      mark.style.left = `${layout.xaxis._offset + east}px`;
      mark.style.top = `${layout.yaxis._offset + north}px`;
    }
  }
}

// What a focused plot holds at the cursor, for those who hear the page.
function speak(plot) {
  if (state.time === null || !plot.panel) { byId("spoken").textContent = byId("readout").textContent; return; }
  const words = plot.panel.rows.flatMap((row) => row.curves.filter((curve) => ["line", "steps"].includes(curve.kind) && curve.role !== "gate" && !plot.hidden.has(curve.name))
    .map((curve) => `${row.label}, ${curve.name} ${Number(valueAt(curve.x, curve.y, state.time).toPrecision(3))} ${row.unit === "1" ? "" : row.unit}`));
  byId("spoken").textContent = `${byId("readout").textContent}: ${words.join("; ")}`;
}

function keys(plot, event) {
  if (event.target !== event.currentTarget || event.ctrlKey || event.altKey || event.metaKey) return;
  const [a, b] = state.span, side = { ArrowLeft: -1, ArrowRight: 1 }[event.key], inside = state.time !== null && state.time >= a && state.time <= b;
  const move = (time) => { cursor(Math.min(Math.max(time, a), b)); speak(plot); };
  if (side && event.shiftKey) pan(0.25 * side);
  else if (side) move((inside ? state.time : 0.5 * (a + b)) + (side * (b - a)) / 100);
  else if (event.key === "Home") move(a);
  else if (event.key === "End") move(b);
  else if (event.key === "+" || event.key === "=") zoom(2);
  else if (event.key === "-") zoom(0.5);
  else if (event.key === "0") show([...state.full]);
  else if (event.key === "Escape") cursor(null);
  else return;
  event.preventDefault();
}

function controls() {
  const from = byId("from"), to = byId("to"), slider = byId("cursor"), scale = byId("scale");
  for (const field of [from, to]) field.addEventListener("change", () => show([from.valueAsNumber - state.shift, to.valueAsNumber - state.shift]));
  const actions = { all: () => show([...state.full]), nearer: () => zoom(2), farther: () => zoom(0.5), earlier: () => pan(-0.25), later: () => pan(0.25) };
  for (const [id, action] of Object.entries(actions)) byId(id).addEventListener("click", action);
  slider.addEventListener("input", () => cursor(state.span[0] + (slider.valueAsNumber / 1000) * (state.span[1] - state.span[0])));
  const { clock } = state.data;
  if (clock && clock.tow) {
    state.shift = clock.tow;
    scale.closest("label").hidden = false;
    scale.addEventListener("change", () => {
      state.shift = scale.value === "log" ? 0 : clock.tow;
      state.span = [...state.span];
      fields();
      refresh();
    });
  }
  fields();
}
