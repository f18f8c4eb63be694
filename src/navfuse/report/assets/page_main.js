// Puts the page together: unpacks, prepares every plot, and draws those that come into view.
function legend(plot, curves) {
  const line = document.createElement("div");
  line.className = "legend";
  for (const name of new Set(curves.map((curve) => curve.name))) {
    const curve = curves.find((found) => found.name === name), button = document.createElement("button"), sign = document.createElement("i");
    button.type = "button";
    button.setAttribute("aria-pressed", "true");
    sign.setAttribute("aria-hidden", "true");
    sign.style.setProperty("--c", `var(--${curve.role}, var(--unused))`);
    const dash = curve.dash || dashes[curve.role];
    sign.className = curve.kind === "band" || curve.role === "outage" ? "band" : curve.kind === "points" ? "dots" : dash && dash !== "solid" ? (dash === "dot" ? "dotted" : "dashed") : "";
    sign.textContent = curve.kind === "points" ? glyphs[curve.role] || "●" : "";
    button.append(sign, name);
    button.addEventListener("click", () => {
      const gone = plot.hidden.delete(name) ? false : Boolean(plot.hidden.add(name));
      button.setAttribute("aria-pressed", String(!gone));
      draw(plot);
    });
    line.append(button);
  }
  const tools = document.createElement("span");
  tools.className = "tools";
  if (!plot.panel) mapButtons(tools);
  const save = document.createElement("button");
  save.type = "button";
  save.className = "tool";
  save.textContent = "Save picture";
  save.setAttribute("aria-label", `Save picture: ${plot.name}`);
  save.addEventListener("click", () => {
    if (!plot.drawn) draw(plot);
    Plotly.downloadImage(plot.box, { format: "svg", filename: plot.name.toLowerCase().replace(/[^a-z0-9]+/g, "-"), width: plot.box.clientWidth, height: plot.box.clientHeight });
  });
  tools.append(save);
  line.append(tools);
  plot.box.parentElement.before(line);
}

function prepare(box, panel) {
  const mark = document.createElement("div"), holder = document.createElement("div");
  const plot = { box, panel, mark, name: panel ? panel.title : "Map", hidden: new Set(), drawn: false, visible: false };
  mark.className = panel ? "cursor" : "spot";
  mark.hidden = true;
  holder.className = "plot";
  holder.style.height = box.style.height;
  if (follows(plot)) {
    holder.tabIndex = 0;
    holder.setAttribute("role", "group");
    holder.setAttribute("aria-label", `${plot.name}, plot with cursor`);
    holder.setAttribute("aria-describedby", "keys");
    holder.addEventListener("keydown", (event) => keys(plot, event));
  }
  box.replaceWith(holder);
  box.className = "chart";
  box.style.height = "100%";
  holder.append(box, mark);
  plots.set(box, plot);
  return plot;
}

async function start() {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old to unpack the plots; any of 2023 or later can");
  const [library, json, buffer] = await Promise.all([inflate("plotly").text(), inflate("data").json(), inflate("numbers").arrayBuffer()]);
  const script = document.createElement("script"), block = new Uint8Array(buffer);
  script.textContent = library;
  document.head.append(script);
  if (typeof Plotly === "undefined") throw new Error("the plotting library did not start");
  state.data = json;
  state.full = [json.start, json.end > json.start ? json.end : json.start + 1];
  state.span = state.full;
  for (const curve of [...json.map.tracks, ...json.map.clouds]) decode(curve, block, json.start);
  for (const panel of json.panels) for (const row of panel.rows) for (const curve of row.curves) decode(curve, block, panel.x ? 0 : json.start);
  controls();
  map = prepare(document.querySelector("#map .plot"), null);
  map.best = json.map.tracks.find((curve) => curve.role === "smoothed") || json.map.tracks.find((curve) => curve.role === "forward");
  legend(map, [...json.map.clouds, ...json.map.tracks]);
  document.querySelectorAll("[data-panel]").forEach((box) => {
    const plot = prepare(box, json.panels[Number(box.dataset.panel)]);
    legend(plot, plot.panel.rows.flatMap((row) => row.curves));
  });
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const plot = plots.get(entry.target);
      plot.visible = entry.isIntersecting;
      if (plot.visible && (!plot.drawn || stale(plot))) draw(plot);
    }
    cursor(state.time);
  }, { rootMargin: "500px" });
  for (const box of plots.keys()) watcher.observe(box);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach((plot) => plot.drawn && draw(plot)));
  addEventListener("beforeprint", () => plots.forEach((plot) => plot.drawn || draw(plot)));
  let later;
  addEventListener("resize", () => { clearTimeout(later); later = setTimeout(refresh, 200); });
  byId("message").remove();
  document.body.dataset.ready = "yes";
}

start().catch((error) => {
  byId("message").textContent = `The plots cannot be shown: ${error.message}`;
  document.body.dataset.ready = "no";
});
