"use strict";
// Curves over one horizontal axis, a panel for each quantity.

const STRIP = 20, FOOT = 40, GAP = 8, EDGE = 10;

class PanelsFigure {
  constructor(holder, spec) {
    this.holder = holder;
    this.spec = spec;
    this.legend = legendOf(spec);
    this.whole = wholeRange(spec);
    [this.low, this.high] = this.whole;
    this.chosen = spec.panels.map(() => null);  // ranges of values that were chosen by a drag
    this.reading = null;  // the place that is read out
    this.band = null;  // what is dragged: x0, x1 as shares of a panel, and y0, y1 in one panel or none
    this.redraw = oncePerPicture(() => this.draw());
    this.reread = oncePerPicture(() => this.read());
    bar(holder, spec, this.legend, this.tools(), this.redraw);
    this.svg = drawn("svg", { class: "plot-drawing", tabindex: 0, role: "img" }, holder);
    this.svg.setAttribute("aria-label", holder.getAttribute("aria-label") || "");
    this.draw();
    listenToPanels(this);
  }

  tools() {
    return [
      { label: "+", title: "Zoom in", act: () => this.zoom(0.5) },
      { label: "\u2212", title: "Zoom out", act: () => this.zoom(2) },
      { label: "\u2190", title: "To the left", act: () => this.shift(-0.25) },
      { label: "\u2192", title: "To the right", act: () => this.shift(0.25) },
      { label: "Whole", title: "Show everything", act: () => this.reset() },
      { label: "Save", title: "Save this view as SVG", act: () => save(this.svg, this.holder.dataset.plot) },
    ];
  }

  /** Place the panels in the width that there is: below each other where it is narrow. */
  place() {
    const { spec } = this, width = Math.max(260, this.holder.clientWidth || 700);
    const columns = width < 560 ? 1 : spec.columns, cell = width / columns, left = cell < 420 ? 50 : 62;
    const own = spec.columns > 1, pitch = spec.height + (own ? FOOT : 0), count = spec.panels.length;
    this.width = width;
    this.height = Math.ceil(count / columns) * pitch + (own ? 0 : FOOT);
    this.boxes = spec.panels.map((panel, i) => ({
      panel, i, foot: own || i === count - 1, x: (i % columns) * cell + left, width: cell - left - EDGE,
      y: Math.floor(i / columns) * pitch + STRIP, height: spec.height - STRIP - GAP,
    }));
  }

  visible(i) { return this.spec.curves.filter((curve) => curve.panel === i && this.legend.get(curve.name).shown); }
  across(box, x) { return box.x + ((x - this.low) / (this.high - this.low)) * box.width; }

  /** First and last point of a curve in the visible range; with `beyond`, one more on each side. */
  inRange(curve, beyond) {
    const first = (this.low - curve.x0) / curve.dx, last = (this.high - curve.x0) / curve.dx;
    return [
      Math.max(0, beyond ? Math.floor(first) : Math.ceil(first - 1e-9)),
      Math.min(curve.y.length - 1, beyond ? Math.ceil(last) : Math.floor(last + 1e-9)),
    ];
  }

  /** Range of a panel's values: what is chosen, or what its visible curves take in the visible range. */
  values(panel, i) {
    if (this.chosen[i]) { return this.chosen[i]; }
    let [least, most] = panel.span || [Infinity, -Infinity];
    this.visible(i).forEach((curve) => {
      const [first, last] = this.inRange(curve, false);
      curve.y.slice(first, last + 1).filter((value) => value !== null).forEach((value) => {
        least = Math.min(least, value);
        most = Math.max(most, value);
      });
    });
    if (least > most) { return [0, 1]; }
    const margin = 0.06 * (most - least) || Math.abs(most) || 1;
    return [panel.from_zero && least >= 0 ? 0 : least - margin, most + margin];
  }

  draw() {
    const { svg } = this;
    this.place();
    svg.replaceChildren();
    filled(svg, { viewBox: `0 0 ${this.width} ${this.height}`, width: this.width, height: this.height });
    this.boxes.forEach((box) => this.drawPanel(box));
    this.marks = drawn("g", {}, svg);
    this.read();
  }

  drawPanel(box) {
    const { svg, spec } = this, { panel, i, x, y, width, height } = box, clip = `${this.holder.dataset.plot}-${i}`;
    box.range = this.values(panel, i);
    box.up = (value) => y + height * (1 - (value - box.range[0]) / (box.range[1] - box.range[0]));
    drawn("rect", { x, y, width, height }, drawn("clipPath", { id: clip }, svg));
    const inside = drawn("g", { "clip-path": `url(#${clip})` }, svg);
    spec.shades.forEach((shade) => {
      const from = this.across(box, shade.start), size = this.across(box, shade.stop) - from;
      drawn("rect", { class: `shade ${shade.name}`, x: from, y, width: size, height }, inside);
    });
    this.horizontal(box).forEach((tick) => {
      drawn("path", { class: "grid", d: `M${tick.x} ${y}v${height}` }, inside);
      const place = { class: "tick", x: tick.x, y: y + height + 15, "text-anchor": "middle" };
      if (box.foot) { drawn("text", place, svg, tick.text); }
    });
    ticks(box.range[0], box.range[1], 5).forEach((tick) => {
      drawn("path", { class: tick.at === 0 ? "zero" : "grid", d: `M${x} ${box.up(tick.at)}h${width}` }, inside);
      drawn("text", { class: "tick", x: x - 5, y: box.up(tick.at) + 4, "text-anchor": "end" }, svg, tick.text);
    });
    this.visible(i).forEach((curve) => this.drawCurve(curve, box, inside));
    drawn("rect", { class: "frame", x, y, width, height }, svg);
    box.title = drawn("text", { x, y: y - 6 }, svg, panel.unit ? `${panel.label} [${panel.unit}]` : panel.label);
    const place = { class: "axis", x: x + width / 2, y: y + height + 32, "text-anchor": "middle" };
    box.axis = box.foot ? drawn("text", place, svg, spec.axis) : null;
  }

  /** Ticks of the horizontal axis: numbers, or the names of categories. */
  horizontal(box) {
    const names = this.spec.categories.map((text, at) => ({ at, text }));
    const found = names.length
      ? names.filter((each) => each.at >= this.low && each.at <= this.high)
      : ticks(this.low, this.high, Math.max(3, Math.floor(box.width / 70)));
    return found.map((tick) => ({ x: this.across(box, tick.at), text: tick.text }));
  }

  drawCurve(curve, box, inside) {
    const [first, last] = this.inRange(curve, true), parts = [];
    let pen = "M";
    for (let k = first; k <= last; k += 1) {
      if (curve.y[k] === null) {
        pen = "M";
      } else {
        const x = this.across(box, curve.x0 + k * curve.dx).toFixed(2), y = box.up(curve.y[k]).toFixed(2);
        parts.push(`${pen}${x} ${y}`);
        pen = "L";
        if (curve.points) { drawn("circle", { class: `point ${curve.style}`, cx: x, cy: y, r: 3.5 }, inside); }
      }
    }
    drawn("path", { class: `curve ${curve.style}`, d: parts.join("") }, inside);
  }

  /** Show the values at the place that is read, and the band that is dragged. */
  read() {
    const { marks, band, reading } = this;
    marks.replaceChildren();
    this.boxes.forEach((box) => {
      if (box.axis) { box.axis.textContent = this.spec.axis; }
      if (band && (band.i === undefined || band.i === box.i)) {
        const [from, to] = [band.x0, band.x1].sort((a, b) => a - b);
        const [y0, y1] = band.i === undefined ? [0, 1] : [band.y0, band.y1].sort((a, b) => a - b);
        const size = { width: (to - from) * box.width, height: (y1 - y0) * box.height };
        drawn("rect", { class: "band", x: box.x + from * box.width, y: box.y + y0 * box.height, ...size }, marks);
      }
      if (reading !== null && reading >= this.low && reading <= this.high) { this.readPanel(box); }
    });
  }

  readPanel(box) {
    const { marks, reading, spec } = this, shown = this.visible(box.i);
    const crowded = shown.length * 56 + box.title.textContent.length * 6.5 > box.width;
    const top = box.y + (crowded ? 14 : -6);  // beside the title, or below it where there is no room
    drawn("path", { class: "cursor", d: `M${this.across(box, reading)} ${box.y}v${box.height}` }, marks);
    const line = drawn("text", { class: "reading", x: box.x + box.width - 8, y: top, "text-anchor": "end" }, marks);
    shown.forEach((curve) => {
      const k = Math.round((reading - curve.x0) / curve.dx), value = curve.y[k];
      drawn("tspan", { class: `value ${curve.style}`, dx: 8 }, line, readable(value));
      if (value === null || value === undefined) { return; }
      const place = { cx: this.across(box, curve.x0 + k * curve.dx), cy: box.up(value), r: 3 };
      drawn("circle", { class: `mark ${curve.style}`, ...place }, marks);
    });
    const place = spec.categories.length ? spec.categories[Math.round(reading)] : reading.toFixed(3);
    if (box.axis) { box.axis.textContent = `${spec.axis}: ${place}`; }
  }

  /** Show a part of the horizontal axis, as wide as asked where the whole is. */
  view(from, to) {
    const all = this.whole[1] - this.whole[0], width = Math.min(to - from, all);
    if (!(width > 1e-6 * all)) { return; }
    this.low = Math.max(this.whole[0], Math.min(from, this.whole[1] - width));
    this.high = this.low + width;
    this.redraw();
  }

  zoom(factor) {
    const inside = this.reading !== null && this.reading > this.low && this.reading < this.high;
    const middle = inside ? this.reading : (this.low + this.high) / 2;
    this.view(middle - (middle - this.low) * factor, middle + (this.high - middle) * factor);
  }

  shift(share) { this.view(this.low + share * (this.high - this.low), this.high + share * (this.high - this.low)); }

  reset() {
    this.chosen.fill(null);
    this.view(...this.whole);
  }
}

/** From before the first to after the last instant of all curves, by a step of theirs; categories by half a place. */
function wholeRange(spec) {
  const curves = spec.curves.filter((curve) => curve.y.length), share = spec.categories.length ? 0.5 : 1;
  if (!curves.length) { return [0, 1]; }
  const from = Math.min(...curves.map((curve) => curve.x0 - share * curve.dx));
  return [from, Math.max(...curves.map((curve) => curve.x0 + (curve.y.length - 1 + share) * curve.dx))];
}
