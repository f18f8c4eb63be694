"use strict";
(() => {
  const root = document.documentElement;
  const coarse = matchMedia("(pointer: coarse)").matches;
  const symbols = { used: "circle", reset: "star", rejected: "x-thin-open", withheld: "diamond-open", late: "triangle-up-open", unused: "circle-open" };
  const glyphs = { used: "●", reset: "★", rejected: "✕", withheld: "◇", late: "△", unused: "○" };
  const dotted = new Set(["truth", "guide"]);
  const plots = new Map();
  let data, full, span, mapPlot;

  const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const color = (role) => css(`--${role}`);
  const safe = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const bytes = (text) => {
    const raw = atob(text.trim()), out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out;
  };
  const inflate = (id) => new Response(
    new Blob([bytes(document.getElementById(id).textContent)]).stream().pipeThrough(new DecompressionStream("gzip"))
  ).text();
  const floats = (text) => Float64Array.from(new Float32Array(bytes(text).buffer));
  const times = (text) => floats(text).map((t) => t + data.start);

  function decode(curve) {
    curve.x = times(curve.x);
    for (const key of ["y", "y2", "e"]) if (curve[key] !== undefined) curve[key] = floats(curve[key]);
  }

  function lowerBound(x, value) {
    let low = 0, high = x.length;
    while (low < high) { const mid = (low + high) >> 1; if (x[mid] < value) low = mid + 1; else high = mid; }
    return low;
  }

  function extent(curve, range) {
    let first = lowerBound(curve.x, range[0]), last = lowerBound(curve.x, range[1]);
    if (curve.kind !== "points") { first = Math.max(first - 1, 0); last = Math.min(last + 1, curve.x.length); }
    let low = Infinity, high = -Infinity;
    for (let i = first; i < last; i++) {
      const y = curve.y[i], top = curve.y2 ? curve.y2[i] : y;
      if (y < low) low = y;
      if (top > high) high = top;
    }
    return [low, high];
  }

  function yRange(row, range, hidden) {
    let low = Infinity, high = -Infinity, bandLow = Infinity, bandHigh = -Infinity;
    for (const curve of row.curves) {
      if (hidden.has(curve.name)) continue;
      const [a, b] = extent(curve, range);
      if (curve.kind === "band") { bandLow = Math.min(bandLow, a); bandHigh = Math.max(bandHigh, b); }
      else { low = Math.min(low, a); high = Math.max(high, b); }
    }
    if (low > high) { low = bandLow; high = bandHigh; }
    if (low > high) return [-1, 1];
    if (row.log) {
      const a = Math.log10(Math.max(low, 1e-12)), b = Math.log10(Math.max(high, 1e-12)), pad = Math.max(0.08 * (b - a), 0.05);
      return [a - pad, b + pad];
    }
    const reach = row.zero ? 4 * Math.max(high - low, 1e-12) : Infinity;
    if (bandLow < bandHigh) { low = Math.min(low, Math.max(bandLow, low - reach)); high = Math.max(high, Math.min(bandHigh, high + reach)); }
    if (row.zero) { const top = Math.max(Math.abs(low), Math.abs(high)); low = -top; high = top; }
    const size = Math.max(Math.abs(low), Math.abs(high)), flat = high - low <= 1e-7 * size;
    const pad = flat ? 0.1 * size || 1 : 0.06 * (high - low);
    return [low - pad, high + pad];
  }

  function frame() {
    const axis = { color: color("soft"), gridcolor: color("grid"), linecolor: color("line"), zerolinecolor: color("line"), zeroline: false };
    return {
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, autosize: true,
      font: { family: "system-ui, sans-serif", size: 12, color: color("ink") },
      hoverlabel: { bgcolor: color("card"), bordercolor: color("line"), font: { color: color("ink") } },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: color("soft"), activecolor: color("ink") },
      axis,
    };
  }
  const config = (buttons) => ({ responsive: true, displaylogo: false, showTips: false, displayModeBar: coarse ? false : "hover", modeBarButtons: [buttons] });

  function trace(curve, axis, unit, hidden) {
    const c = color(curve.role), visible = !hidden.has(curve.name);
    const base = { type: "scatter", name: safe(curve.name), yaxis: axis, visible, x: curve.x };
    const label = `%{y:.4g} ${unit === "1" ? "" : safe(unit)}`;
    if (curve.kind === "band") {
      const edge = { mode: "lines", line: { width: 0 }, hoverinfo: "skip" };
      return [{ ...base, ...edge, y: curve.y }, { ...base, ...edge, y: curve.y2, fill: "tonexty", fillcolor: c + "2e" }];
    }
    if (curve.kind === "points") {
      const filled = curve.role === "used" || curve.role === "reset", size = curve.role === "used" ? 4 : 7;
      const marked = { size, line: { color: c, width: filled ? 0 : 1.4 } };
      return [{ ...base, mode: "markers", y: curve.y, hovertemplate: label, marker: { color: c, symbol: symbols[curve.role] || "circle", ...marked } }];
    }
    const line = { color: c, width: curve.role === "truth" ? 1.2 : 1.5, dash: dotted.has(curve.role) ? "dot" : "solid" };
    return [{ ...base, mode: "lines", y: curve.y, hovertemplate: label, line }];
  }

  function timeFigure(plot) {
    const { axis, ...layout } = frame(), rows = plot.panel.rows, gap = 0.22 / Math.max(rows.length * 2, 3), traces = [];
    const height = (1 - gap * (rows.length - 1)) / rows.length;
    rows.forEach((row, i) => {
      const suffix = i ? String(i + 1) : "", top = 1 - i * (height + gap);
      layout[`yaxis${suffix}`] = {
        ...axis, domain: [Math.max(top - height, 0), top], type: row.log ? "log" : "linear", fixedrange: true, range: yRange(row, span, plot.hidden),
        title: { text: `${safe(row.label)} [${safe(row.unit)}]`, font: { size: 12 }, standoff: 6 }, nticks: 5, zeroline: row.zero, exponentformat: "power",
        ...(row.log ? logTicks(yRange(row, span, plot.hidden)) : {}),
      };
      for (const curve of row.curves) traces.push(...trace(curve, `y${suffix}`, row.unit, plot.hidden));
    });
    layout.xaxis = {
      ...axis, anchor: rows.length > 1 ? `y${rows.length}` : "y", range: [...span], title: { text: "log time [s]", standoff: 6 }, hoverformat: ".2f",
      exponentformat: "none", separatethousands: false,
    };
    layout.shapes = data.shading.map(([a, b]) => ({ type: "rect", xref: "x", yref: "paper", x0: a + data.start, x1: b + data.start, y0: 0, y1: 1, layer: "below",
      line: { width: 0 }, fillcolor: color("shade") }));
    layout.margin = { l: 64, r: 10, t: 8, b: 44 };
    layout.hovermode = "x unified";
    layout.dragmode = coarse ? false : "zoom";
    return [traces, layout];
  }

  function logTicks([a, b]) {
    const width = b - a, step = Math.max(1, Math.ceil(width / 5));
    const heads = width > 2 ? [1] : width > 0.9 ? [1, 3] : width > 0.45 ? [1, 2, 5] : [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8];
    const tickvals = [];
    for (let power = step * Math.floor(a / step); power <= b; power += step)
      for (const head of heads) {
        const place = power + Math.log10(head);
        if (place >= a && place <= b) tickvals.push(head * 10 ** power);
      }
    return { tickmode: "array", tickvals, ticktext: tickvals.map((value) => String(Number(value.toPrecision(2)))) };
  }

  function mapFigure() {
    const { axis, ...layout } = frame(), traces = [], hidden = mapPlot.hidden;
    const where = "%{x:.2f} m east<br>%{y:.2f} m north<br>t = %{customdata:.2f} s";
    for (const curve of [...data.map.clouds, ...data.map.tracks]) {
      const { x, ...base } = trace({ ...curve, x: curve.e }, "y", "m", hidden)[0];
      traces.push({ ...base, x, customdata: curve.x, hovertemplate: where });
    }
    const best = mapPlot.best;
    traces.push({ type: "scatter", mode: "markers", x: [best.e[0]], y: [best.y[0]], name: "start", hovertemplate: "start",
      marker: { size: 12, symbol: "star", color: color("ink"), line: { color: color("paper"), width: 1 } } });
    const zoomed = span[0] > full[0] || span[1] < full[1], first = lowerBound(best.x, span[0]), last = lowerBound(best.x, span[1]);
    traces.push({ type: "scatter", mode: "lines", x: best.e.slice(first, last), y: best.y.slice(first, last), hoverinfo: "skip", visible: zoomed,
      name: "time shown", line: { color: color("check"), width: 6 }, opacity: 0.55 });
    layout.xaxis = { ...axis, title: { text: "east of the start [m]", standoff: 6 }, zeroline: false, exponentformat: "none" };
    layout.yaxis = { ...axis, title: { text: "north of the start [m]" }, scaleanchor: "x", scaleratio: 1, zeroline: false, exponentformat: "none" };
    layout.margin = { l: 68, r: 10, t: 8, b: 48 };
    layout.hovermode = "closest";
    layout.dragmode = coarse ? false : "pan";
    layout.uirevision = "map";
    return [traces, layout];
  }

  function draw(plot) {
    const [traces, layout] = plot.panel ? timeFigure(plot) : mapFigure();
    Plotly.react(plot.box, traces, layout, config(plot.panel ? ["toImage"] : ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]));
    plot.span = span;
    if (plot.drawn) return;
    plot.drawn = true;
    plot.box.dataset.drawn = "yes";
    plot.box.on("plotly_hover", (event) => cursor(plot.panel ? event.points[0].x : event.points[0].customdata));
    plot.box.on("plotly_unhover", () => cursor(null));
    if (!plot.panel) return;
    plot.box.on("plotly_relayout", (change) => {
      if (change["xaxis.autorange"]) show([...full]);
      else if (change["xaxis.range[0]"] !== undefined) show([change["xaxis.range[0]"], change["xaxis.range[1]"]]);
      else if (change["xaxis.range"]) show(change["xaxis.range"]);
    });
    plot.box.on("plotly_doubleclick", () => { show([...full]); return false; });
  }

  function show(range) {
    const from = Math.max(Number(range[0]), full[0]), to = Math.min(Number(range[1]), full[1]);
    if (!(to > from) || (from === span[0] && to === span[1])) return;
    span = [from, to];
    document.getElementById("from").value = from.toFixed(2);
    document.getElementById("to").value = to.toFixed(2);
    refresh();
  }

  function refresh() {
    for (const plot of plots.values()) if (plot.drawn && plot.visible && plot.span !== span) draw(plot);
  }

  function cursor(time) {
    for (const plot of plots.values()) {
      if (!plot.drawn || !plot.visible) continue;
      const layout = plot.box._fullLayout, mark = plot.mark;
      mark.hidden = time === null || (plot.panel && (time < span[0] || time > span[1]));
      if (mark.hidden) continue;
      if (plot.panel) {
        mark.style.left = `${layout.xaxis._offset + layout.xaxis.d2p(time)}px`;
        mark.style.height = `${layout._size.t + layout._size.h}px`;
      } else {
        const best = plot.best, i = Math.min(lowerBound(best.x, time), best.x.length - 1);
        mark.style.left = `${layout.xaxis._offset + layout.xaxis.d2p(best.e[i])}px`;
        mark.style.top = `${layout.yaxis._offset + layout.yaxis.d2p(best.y[i])}px`;
      }
    }
  }

  function legend(plot, curves) {
    const line = document.createElement("div");
    line.className = "legend";
    for (const name of new Set(curves.map((curve) => curve.name))) {
      const curve = curves.find((found) => found.name === name), button = document.createElement("button"), sign = document.createElement("i");
      button.type = "button";
      button.setAttribute("aria-pressed", "true");
      sign.style.setProperty("--c", `var(--${curve.role})`);
      sign.className = curve.kind === "band" ? "band" : curve.kind === "points" ? "dots" : dotted.has(curve.role) ? "dotted" : "";
      sign.textContent = curve.kind === "points" ? glyphs[curve.role] || "●" : "";
      button.append(sign, name);
      button.addEventListener("click", () => {
        const gone = plot.hidden.delete(name) ? false : Boolean(plot.hidden.add(name));
        button.setAttribute("aria-pressed", String(!gone));
        draw(plot);
      });
      line.append(button);
    }
    plot.box.parentElement.before(line);
  }

  function prepare(box, panel) {
    const mark = document.createElement("div"), plot = { box, panel, mark, hidden: new Set(), drawn: false, visible: false };
    mark.className = panel ? "cursor" : "spot";
    mark.hidden = true;
    const holder = document.createElement("div");
    holder.className = "plot";
    holder.style.height = box.style.height;
    box.replaceWith(holder);
    box.className = "chart";
    box.style.height = "100%";
    holder.append(box, mark);
    plots.set(box, plot);
    return plot;
  }

  async function start() {
    if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old to unpack the plots; any of 2023 or later can");
    const [library, json] = await Promise.all([inflate("plotly"), inflate("data")]);
    const script = document.createElement("script");
    script.textContent = library;
    document.head.append(script);
    data = JSON.parse(json);
    full = [data.start, data.end];
    span = full;
    for (const curve of [...data.map.tracks, ...data.map.clouds]) decode(curve);
    for (const panel of data.panels) for (const row of panel.rows) row.curves.forEach(decode);
    mapPlot = prepare(document.querySelector("#map .plot"), null);
    mapPlot.best = data.map.tracks.find((curve) => curve.role === "smoothed") || data.map.tracks[0];
    legend(mapPlot, [...data.map.clouds, ...data.map.tracks]);
    document.querySelectorAll("[data-panel]").forEach((box) => {
      const plot = prepare(box, data.panels[Number(box.dataset.panel)]);
      legend(plot, plot.panel.rows.flatMap((row) => row.curves));
    });
    const watcher = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const plot = plots.get(entry.target);
        plot.visible = entry.isIntersecting;
        if (plot.visible && (!plot.drawn || plot.span !== span)) draw(plot);
      }
    }, { rootMargin: "500px" });
    for (const box of plots.keys()) watcher.observe(box);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach((plot) => plot.drawn && draw(plot)));
    addEventListener("beforeprint", () => plots.forEach((plot) => plot.drawn || draw(plot)));
    const from = document.getElementById("from"), to = document.getElementById("to");
    from.value = full[0].toFixed(2);
    to.value = full[1].toFixed(2);
    for (const field of [from, to]) field.addEventListener("change", () => show([from.valueAsNumber, to.valueAsNumber]));
    document.getElementById("all").addEventListener("click", () => show([...full]));
    document.getElementById("message").remove();
    document.body.dataset.ready = "yes";
  }

  start().catch((error) => {
    document.getElementById("message").textContent = `The plots cannot be shown: ${error.message}`;
    document.body.dataset.ready = "no";
  });
})();
