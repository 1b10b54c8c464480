"use strict";
// Sets the page going: particles at once, charts when they come into sight.

const COLOURS = { light: ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b87800", "#3f93c9"], dark: ["#56b4e9", "#f0804f", "#2fc49b", "#e39bc3", "#e6b13c", "#9fd0f2"] };
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash"];

const report = JSON.parse(document.getElementById("report").textContent);
window.spume = { report, ready: false, charted: 0 };

function complain(id, error) {
  const place = document.getElementById(id);
  if (place) {
    place.hidden = false;
    place.textContent =
      typeof DecompressionStream === "undefined"
        ? "This browser is too old to unpack the data of this page (it lacks DecompressionStream): open it in a browser of 2023 or later."
        : String(error);
  }
}

async function particles() {
  const views = [];
  const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const maps = { continuous: bytesOf(report.maps.continuous), categories: bytesOf(report.maps.categories) };
  for (const [index, run] of report.runs.entries()) {
    if (!run.particles) continue;
    const bytes = await inflated(`particles-${index}`);
    const view = new View(document.getElementById(`view-${index}`), run.particles, bytes, maps);
    view.name = run.name;
    views.push(view);
  }
  if (views.length) window.spume.player = new Player(views, report.ranges);
}

let plotly = null;
/** Plotly, unpacked when it is first needed. */
function library() {
  plotly ??= inflated("plotly").then((bytes) => {
    const script = document.createElement("script");
    script.textContent = new TextDecoder().decode(bytes);
    document.head.append(script);
    return window.Plotly;
  });
  return plotly;
}

function traces(chart, dark) {
  const colours = dark ? COLOURS.dark : COLOURS.light, ink = dark ? "#e8eaed" : "#222222";
  return chart.lines.flatMap((line) => {
    const common = { x: line.x, name: line.label, hoverlabel: { namelength: -1 } };
    if (line.kind === "band") {
      const edge = { ...common, mode: "lines", line: { width: 0 }, hoverinfo: "skip", legendgroup: "band" };
      return [
        { ...edge, y: line.lower, showlegend: false },
        { ...edge, y: line.upper, fill: "tonexty", fillcolor: dark ? "rgba(160,166,173,0.35)" : "rgba(120,126,134,0.30)" }];
    }
    if (line.kind === "points") return [{ ...common, y: line.y, mode: "markers", marker: { color: ink, size: 5 } }];
    if (line.kind === "measured") return [{ ...common, y: line.y, mode: "lines", line: { color: ink, width: 1.4 } }];
    const colour = colours[line.colour % colours.length];
    return [{ ...common, y: line.y, mode: "lines", line: { color: colour, width: 1.6, dash: DASHES[line.dash % DASHES.length] } }];
  });
}

function layout(chart, dark) {
  // A finger scrolls the page; a mouse draws the part of a chart to enlarge.
  const dragmode = matchMedia("(pointer: coarse)").matches ? false : "zoom";
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink").trim(), grid = style.getPropertyValue("--grid").trim();
  const axis = { gridcolor: grid, zerolinecolor: grid, linecolor: grid, ticks: "outside", tickcolor: grid, automargin: true };
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size: 12, family: "system-ui, sans-serif" },
    dragmode, margin: { l: 60, r: 12, t: 8, b: 44 }, hovermode: "closest", showlegend: chart.lines.length > 1,
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, xanchor: "left" },
    xaxis: { ...axis, title: { text: chart.x }, ...(chart.end ? { range: [0, chart.end] } : {}) },
    yaxis: { ...axis, title: { text: chart.y }, type: chart.log ? "log" : "linear", exponentformat: "power" },
    shapes: (chart.windows || []).flatMap((ends) => ends.map((x) => (
      { type: "line", x0: x, x1: x, y0: 0, y1: 1, yref: "paper", line: { color: dark ? "#8a9099" : "#888", width: 1, dash: "dash" } }))),
  };
}

async function draw(place) {
  const chart = report.charts[Number(place.dataset.chart)];
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  try {
    const library_ = await library();
    await library_.react(place, traces(chart, dark), layout(chart, dark), {
      responsive: true, displayModeBar: false });
    if (!place.dataset.drawn) window.spume.charted++;
    place.dataset.drawn = "yes";
  } catch (error) {
    complain("trouble", error);
    throw error;
  }
}

function charts() {
  const places = [...document.querySelectorAll("[data-chart]")];
  const watcher = new IntersectionObserver(
    (entries) => {
      for (const entry of entries) {
        if (!entry.isIntersecting) continue;
        watcher.unobserve(entry.target);
        draw(entry.target);
      }
    },
    { rootMargin: "300px" });
  for (const place of places) watcher.observe(place);
  const again = () => places.filter((place) => place.dataset.drawn).forEach(draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  window.addEventListener("beforeprint", () => places.forEach(draw));
}

particles()
  .catch((error) => {
    complain("trouble", error);
    console.error(error);
  })
  .finally(() => {
    window.spume.ready = true;
    performance.mark("ready");
    // The animation is seen first; charts come after it.
    setTimeout(charts, 0);
  });
