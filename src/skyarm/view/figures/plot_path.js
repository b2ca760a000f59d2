"use strict";
// Paths in space, seen from where one likes: a drag turns, Shift and a drag move, the point under the pointer is read.

const FIRST_VIEW = { azimuth: 0.785, elevation: 0.36, zoom: 1, right: 0, up: 0 };
const NEAR = 24;

class PathFigure {
  constructor(holder, spec) {
    this.holder = holder;
    this.spec = spec;
    this.legend = legendOf(spec);
    this.eye = { ...FIRST_VIEW };
    this.found = null;  // the point that is read out
    this.redraw = oncePerPicture(() => this.draw());
    this.ranges = ["x", "y", "z"].map((axis) => {
      const all = spec.curves.flatMap((curve) => curve[axis].filter((value) => value !== null));
      const low = all.reduce((a, b) => Math.min(a, b), Infinity);
      const high = all.reduce((a, b) => Math.max(a, b), -Infinity);
      const margin = 0.04 * (high - low) || 0.5;
      return all.length ? [low - margin, high + margin] : [0, 1];
    });
    bar(holder, spec, this.legend, this.tools(), this.redraw);
    this.svg = drawn("svg", { class: "plot-drawing", tabindex: 0, role: "img" }, holder);
    this.svg.setAttribute("aria-label", holder.getAttribute("aria-label") || "");
    this.draw();
    this.listen();
  }

  tools() {
    return [
      { label: "+", title: "Zoom in", act: () => this.turn({ zoom: this.eye.zoom * 1.4 }) },
      { label: "\u2212", title: "Zoom out", act: () => this.turn({ zoom: this.eye.zoom / 1.4 }) },
      { label: "\u21ba", title: "Turn to the left", act: () => this.turn({ azimuth: this.eye.azimuth - 0.3 }) },
      { label: "\u21bb", title: "Turn to the right", act: () => this.turn({ azimuth: this.eye.azimuth + 0.3 }) },
      { label: "Whole", title: "The first view", act: () => this.turn(FIRST_VIEW) },
      { label: "Save", title: "Save this view as SVG", act: () => save(this.svg, this.holder.dataset.plot) },
    ];
  }

  turn(change) {
    Object.assign(this.eye, change);
    this.eye.elevation = Math.max(-1.57, Math.min(1.57, this.eye.elevation));
    this.eye.zoom = Math.max(0.2, Math.min(200, this.eye.zoom));
    this.redraw();
  }

  /** Where a point of the world is drawn: an orthographic view from azimuth and elevation; z upwards. */
  seen(point) {
    const { azimuth, elevation, zoom, right, up } = this.eye, { width, height } = this;
    const [x, y, z] = point.map((value, i) => {
      const [low, high] = this.ranges[i];
      return this.spec.aspect[i] * ((value - low) / (high - low) - 0.5);
    });
    const scale = zoom * Math.min(width / 1.6, height / 1.15);
    const side = -Math.sin(azimuth) * x + Math.cos(azimuth) * y, ahead = Math.cos(azimuth) * x + Math.sin(azimuth) * y;
    const above = Math.cos(elevation) * z - Math.sin(elevation) * ahead;
    return [width / 2 + right + scale * side, height / 2 - up - scale * above];
  }

  draw() {
    const { svg, spec } = this;
    this.width = Math.max(260, this.holder.clientWidth || 700);
    this.height = Math.min(spec.height, Math.max(300, this.width));
    svg.replaceChildren();
    filled(svg, { viewBox: `0 0 ${this.width} ${this.height}`, width: this.width, height: this.height });
    this.drawBox();
    spec.curves.filter((curve) => this.legend.get(curve.name).shown).forEach((curve) => {
      let pen = "M";
      const parts = curve.x.map((_, k) => {
        const point = [curve.x[k], curve.y[k], curve.z[k]];
        if (point.includes(null)) { pen = "M"; return ""; }
        const text = pen + this.seen(point).map((each) => each.toFixed(2)).join(" ");
        pen = "L";
        return text;
      });
      drawn("path", { class: `curve wide ${curve.style}`, d: parts.join("") }, svg);
    });
    this.marks = drawn("g", {}, svg);
    this.read();
  }

  /** Floor and the two walls behind, with lines at round numbers of each axis and texts along three edges. */
  drawBox() {
    const { azimuth, elevation } = this.eye, toward = [Math.cos(azimuth), Math.sin(azimuth), elevation < 0 ? -1 : 1];
    const [nx, ny, nz] = this.ranges.map((range, i) => range[toward[i] > 0 ? 1 : 0]);
    const [fx, fy, fz] = this.ranges.map((range, i) => range[toward[i] > 0 ? 0 : 1]);
    // for each axis: the edge that bears its texts, and the corners of a line over floor and walls
    const lines = [
      [(t) => [t, ny, fz], (t) => [[t, ny, fz], [t, fy, fz], [t, fy, nz]]],
      [(t) => [nx, t, fz], (t) => [[nx, t, fz], [fx, t, fz], [fx, t, nz]]],
      [(t) => [nx, fy, t], (t) => [[nx, fy, t], [fx, fy, t], [fx, ny, t]]],
    ];
    lines.forEach(([edge, corners], axis) => {
      const [low, high] = this.ranges[axis];
      const found = ticks(low, high, 5);
      [low, high, ...found.map((tick) => tick.at)].forEach((at) => {
        const points = corners(at).map((point) => this.seen(point).map((each) => each.toFixed(1)).join(" "));
        drawn("path", { class: "grid", d: `M${points.join("L")}` }, this.svg);
      });
      found.forEach((tick) => this.label(edge(tick.at), tick.text, "tick", 16));
      this.label(edge((low + high) / 2), `${"xyz"[axis]} [m]`, "axis", 44);
    });
  }

  /** A text beside an edge, away from the middle of the picture. */
  label(point, text, kind, distance) {
    const [x, y] = this.seen(point), middle = this.seen(this.ranges.map((range) => (range[0] + range[1]) / 2));
    const away = Math.hypot(x - middle[0], y - middle[1]) || 1, by = (a, b) => a + (distance * (a - b)) / away;
    const place = { x: by(x, middle[0]), y: by(y, middle[1]) + 4 };
    drawn("text", { class: kind, ...place, "text-anchor": "middle" }, this.svg, text);
  }

  read() {
    this.marks.replaceChildren();
    if (!this.found) { return; }
    const { curve, k } = this.found, point = [curve.x[k], curve.y[k], curve.z[k]], [cx, cy] = this.seen(point);
    drawn("circle", { class: `mark ${curve.style}`, cx, cy, r: 4 }, this.marks);
    const text = `${curve.name}: ${point.map((value, i) => `${"xyz"[i]} ${readable(value)}`).join(", ")} m`;
    drawn("text", { class: "reading", x: this.width / 2, y: 16, "text-anchor": "middle" }, this.marks, text);
  }

  /** The point of a visible curve next to a place of the drawing; null if none is near. */
  nearest(x, y) {
    let best = null, least = NEAR;
    this.spec.curves.filter((curve) => this.legend.get(curve.name).shown).forEach((curve) => curve.x.forEach((_, k) => {
      const point = [curve.x[k], curve.y[k], curve.z[k]];
      const [u, v] = point.includes(null) ? [Infinity, Infinity] : this.seen(point), away = Math.hypot(u - x, v - y);
      if (away < least) { [best, least] = [{ curve, k }, away]; }
    }));
    return best;
  }

  listen() {
    const { svg } = this;
    let start = null;
    svg.addEventListener("pointerdown", (event) => {
      start = { x: event.clientX, y: event.clientY, shift: event.shiftKey, ...this.eye };
      if (svg.setPointerCapture) { svg.setPointerCapture(event.pointerId); }
    });
    svg.addEventListener("pointermove", (event) => {
      const edge = svg.getBoundingClientRect();
      if (!start) {
        this.found = this.nearest(event.clientX - edge.left, event.clientY - edge.top);
        this.read();
        return;
      }
      const x = event.clientX - start.x, y = event.clientY - start.y;
      this.turn(start.shift ? { right: start.right + x, up: start.up - y }
        : { azimuth: start.azimuth - 0.01 * x, elevation: start.elevation + 0.01 * y });
    });
    const end = () => { start = null; };
    ["pointerup", "pointercancel", "pointerleave"].forEach((name) => svg.addEventListener(name, end));
    svg.addEventListener("dblclick", () => this.turn(FIRST_VIEW));
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) { return; }  // the page scrolls
      event.preventDefault();
      this.turn({ zoom: this.eye.zoom * (event.deltaY > 0 ? 0.8 : 1.25) });
    }, { passive: false });
    svg.addEventListener("keydown", (event) => {
      const { azimuth, elevation, zoom } = this.eye, changes = {
        ArrowLeft: { azimuth: azimuth - 0.1 }, ArrowRight: { azimuth: azimuth + 0.1 },
        ArrowUp: { elevation: elevation + 0.1 }, ArrowDown: { elevation: elevation - 0.1 },
        "+": { zoom: zoom * 1.4 }, "=": { zoom: zoom * 1.4 }, "-": { zoom: zoom / 1.4 }, 0: FIRST_VIEW,
      };
      if (changes[event.key]) {
        event.preventDefault();
        this.turn(changes[event.key]);
      }
    });
  }
}
