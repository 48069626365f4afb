"use strict";
// Draws the figures of a page with Plotly: each when it comes near the screen, all of them before printing.
(async () => {
  const page = JSON.parse(document.getElementById("panels").textContent);
  const plots = [...document.querySelectorAll(".plot")];
  const zoomed = new Map(); // name of a group -> its range along x; absent: as drawn at first
  const touched = matchMedia("(hover: none)").matches; // on a touch screen a drag scrolls the page, and the buttons always show
  const config = {
    displaylogo: false,
    modeBarButtons: [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d", "toImage"]],
  };
  let following = false;
  const figureOf = plot => page.figures[plot.dataset.figure];
  const unzoomed = plot => {
    const range = figureOf(plot).layout.xaxis.range;
    return range ? { "xaxis.range": [...range] } : { "xaxis.autorange": true };
  };

  const follow = async (plot, change) => {
    const group = figureOf(plot).zoom;
    const range = change["xaxis.range"] ?? [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    if (!group || following || !(change["xaxis.autorange"] || range[1] !== undefined)) return;
    if (change["xaxis.autorange"]) zoomed.delete(group);
    else zoomed.set(group, range);
    following = true;
    for (const other of plots)
      if (other !== plot && other.classList.contains("drawn") && figureOf(other).zoom === group)
        await Plotly.relayout(other, zoomed.has(group) ? { "xaxis.range": [...range] } : unzoomed(other));
    following = false;
  };

  // A view box lets the style sheet shrink a drawing, for example on paper.
  const frame = plot => {
    const { width, height } = plot._fullLayout;
    plot.style.setProperty("--shape", `${width} / ${height}`);
    for (const layer of plot.querySelectorAll(".main-svg")) layer.setAttribute("viewBox", `0 0 ${width} ${height}`);
  };

  const draw = plot => {
    if (plot.classList.contains("drawn")) return;
    const { data, layout, height, zoom } = figureOf(plot);
    plot.setAttribute("role", "img");
    plot.setAttribute("aria-label", plot.textContent);
    plot.textContent = "";
    plot.classList.add("drawn");
    const xaxis = { ...layout.xaxis, ...(zoomed.has(zoom) && { range: [...zoomed.get(zoom)] }) };
    const width = plot.clientWidth || Number(plot.dataset.width);
    const shown = { ...layout, xaxis, width, height, template: page.template };
    if (touched) Object.assign(shown, { dragmode: false, margin: { t: 30 } });
    Plotly.newPlot(plot, data, shown, config);
    frame(plot);
    plot.on("plotly_relayout", change => follow(plot, change));
    plot.on("plotly_afterplot", () => frame(plot));
    widths.observe(plot);
  };

  const widths = new ResizeObserver(changes => {
    for (const { target } of changes)
      if (target.clientWidth && target.clientWidth !== target._fullLayout.width && !matchMedia("print").matches)
        Plotly.relayout(target, { width: target.clientWidth });
  });
  const near = new IntersectionObserver(
    seen => seen.filter(each => each.isIntersecting).forEach(each => draw(each.target)),
    { rootMargin: "600px 0px" },
  );

  document.documentElement.classList.add("js");
  try {
    const letters = atob(document.getElementById("plotly").textContent);
    const packed = new Uint8Array(letters.length);
    for (let k = 0; k < letters.length; k++) packed[k] = letters.charCodeAt(k);
    const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const library = document.createElement("script");
    library.textContent = await new Response(unpacked).text();
    document.head.append(library);
    plots.forEach(plot => near.observe(plot));
    addEventListener("beforeprint", () => plots.forEach(draw));
  } catch (error) {
    document.documentElement.classList.remove("js");
    document.getElementById("no_figures").hidden = false;
    console.warn(error);
  }
})();
