"use strict";
(() => {
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const narrow = () => innerWidth < 600;

  function axis(given, most) {
    return {
      ...given, title: { text: given.title, standoff: 8 }, automargin: true, gridcolor: css("grid"), linecolor: css("line"), zeroline: false,
      tickformat: given.type === "log" ? ",~g" : undefined, nticks: most,
    };
  }

  function trace(given) {
    const color = css(given.role);
    const common = { x: given.x, y: given.y, name: given.name, mode: given.mode, hovertemplate: given.hover };
    if (given.mode === "lines") return { ...common, line: { color, width: given.dash === "solid" ? 1.8 : 1.4, dash: given.dash } };
    const bars = { type: "data", symmetric: false, array: given.up, arrayminus: given.down, thickness: 1, width: 0, color };
    return { ...common, marker: { size: 4.5, color }, error_y: bars };
  }

  function draw() {
    for (const { id, traces, x, y, legend } of panels) {
      const layout = {
        paper_bgcolor: css("paper"), plot_bgcolor: css("paper"), font: { color: css("ink"), family: "system-ui, sans-serif", size: 13 },
        hovermode: "closest", margin: { l: 20, r: 12, t: 12, b: 20 }, xaxis: axis(x, narrow() ? 5 : 8), yaxis: axis(y, 4), showlegend: legend,
        legend: { orientation: "h", x: 0, xanchor: "left", y: -0.18, yanchor: "top", font: { size: 12 }, bgcolor: "rgba(0,0,0,0)" },
      };
      const config = { responsive: true, displaylogo: false, displayModeBar: narrow() ? false : "hover",
        modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
      Plotly.react(id, traces.map(trace), layout, config);
    }
  }

  document.getElementById("message").remove();
  draw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
})();
