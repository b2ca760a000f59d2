"use strict";
// A figure for each holder of the page: a plot for each panel, with one cursor, one zoom and one choice of curves.

(function () {
  const DASHES = {
    "pd": [7, 3], "ct-mujoco": [2, 3], "pd-mujoco": [7, 3, 2, 3], "ct-paper": [2, 3], "pd-paper": [2, 3],
    "other": [10, 4],
  };

  function made(name, parent, attributes, text) {
    const element = parent.appendChild(document.createElement(name));
    Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
    if (text !== undefined) { element.textContent = text; }
    return element;
  }

  /** Range of a panel's values: with what is always in view, from zero where it shall begin there. */
  function range(panel, least, most) {
    const [low, high] = panel.span || [Infinity, -Infinity];
    least = Math.min(least ?? Infinity, low);
    most = Math.max(most ?? -Infinity, high);
    if (least > most) { return [0, 1]; }
    const margin = 0.06 * (most - least) || Math.abs(most) || 1;
    return [panel.from_zero && least >= 0 ? 0 : least - margin, most + margin];
  }

  function draw(holder) {
    const spec = JSON.parse(document.getElementById(holder.dataset.plot).textContent), names = spec.categories;
    const color = (name) => getComputedStyle(holder).getPropertyValue(`--${name}`).trim();
    const bar = made("div", holder, { class: "plot-bar", role: "group", "aria-label": "View" });
    const grid = made("div", holder, { class: "plot-grid" });
    const columns = () => (holder.clientWidth < 560 ? 1 : spec.columns);
    const size = () => ({ width: Math.max(260, holder.clientWidth || 700) / columns() - 4, height: spec.height });

    const plots = spec.panels.map((panel, i) => {
      const curves = spec.curves.filter((curve) => curve.panel === i);
      const tables = curves.map((curve) => [curve.y.map((_, k) => curve.x0 + k * curve.dx), curve.y]);
      const axis = { stroke: () => color("text"), grid: { stroke: () => color("grid"), width: 1 } };
      const across = names.length
        ? { ...axis, splits: () => names.map((_, k) => k), values: (_, places) => places.map((k) => names[k]) }
        : axis;
      const series = curves.map((curve) => ({
        label: curve.name, show: curve.shown, width: curve.style.endsWith("paper") ? 1 : 1.6, dash: DASHES[curve.style],
        stroke: () => color(curve.style.replace("-paper", "")), points: { show: curve.points, size: 7 },
      }));
      const shades = (plot) => spec.shades.forEach((shade) => {
        const [from, to] = [shade.start, shade.stop].map((x) => plot.valToPos(x, "x", true));
        plot.ctx.fillStyle = color(shade.name);
        plot.ctx.fillRect(from, plot.bbox.top, to - from, plot.bbox.height);
      });
      return new uPlot({
        ...size(), title: panel.unit ? `${panel.label} [${panel.unit}]` : panel.label,
        cursor: { sync: { key: holder.dataset.plot, setSeries: true }, drag: { x: true, y: false } },
        scales: { x: { time: false }, y: { range: (_, least, most) => range(panel, least, most) } },
        axes: [across, { ...axis, size: 62 }], hooks: { drawClear: [shades] },
        series: [{ label: spec.axis, value: (_, x) => (names.length ? names[x] : x && x.toFixed(3)) }, ...series],
      }, uPlot.join(tables), grid);
    });

    const button = (text, title, act) => made("button", bar, { type: "button", title }, text).addEventListener("click", act);
    spec.choices.forEach((choice) => button(choice.label, `Show ${choice.label} alone`, () => plots.forEach((plot) => {
      plot.series.slice(1).forEach((each, k) => plot.setSeries(k + 1, { show: choice.names.includes(each.label) }, false));
    })));
    button("Whole", "Show everything; drag across a plot to magnify", () => plots.forEach((plot) => plot.setData(plot.data)));
    spec.shades.forEach((shade) => made("span", bar, { class: `plot-shade ${shade.name}` }, shade.name));
    const place = () => { grid.style.gridTemplateColumns = `repeat(${columns()}, 1fr)`; };
    place();
    window.addEventListener("resize", () => { place(); plots.forEach((plot) => plot.setSize(size())); });
  }

  document.querySelectorAll("[data-plot]").forEach((holder) => window.setTimeout(draw, 0, holder));
}());
