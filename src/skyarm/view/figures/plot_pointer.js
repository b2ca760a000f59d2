"use strict";
// Pointer, wheel and keys on the panels: values under the pointer, zoom by a drag, Shift and a drag to move.

const DRAG = 5, TALL = 24;

function listenToPanels(figure) {
  const { svg } = figure;
  let start = null;

  /** Where an event is: the panel it lies in or next to, and its place there as shares of the panel. */
  function placeOf(event) {
    const edge = svg.getBoundingClientRect(), scale = figure.width / (edge.width || figure.width);
    const x = (event.clientX - edge.left) * scale, y = (event.clientY - edge.top) * scale;
    const away = (box) => Math.hypot(
      Math.max(box.x - x, 0, x - box.x - box.width), Math.max(box.y - y, 0, y - box.y - box.height));
    const box = figure.boxes.reduce((best, each) => (away(each) < away(best) ? each : best));
    const share = (value) => Math.max(0, Math.min(1, value));
    return { box, u: share((x - box.x) / box.width), v: share((y - box.y) / box.height), x, y };
  }

  const valueAt = (u) => figure.low + u * (figure.high - figure.low);
  const categories = figure.spec.categories.length;

  function read(x) {
    figure.reading = categories ? Math.max(0, Math.min(categories - 1, Math.round(x))) : x;
    figure.reread();
  }

  svg.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) { return; }
    start = { ...placeOf(event), shift: event.shiftKey, low: figure.low, high: figure.high };
    if (svg.setPointerCapture) { svg.setPointerCapture(event.pointerId); }
  });

  svg.addEventListener("pointermove", (event) => {
    const here = placeOf(event);
    if (start && start.shift) {
      const moved = ((start.x - here.x) / start.box.width) * (start.high - start.low);
      figure.view(start.low + moved, start.high + moved);
    } else if (start && Math.hypot(here.x - start.x, here.y - start.y) > DRAG) {
      figure.band = bandOf(start, here);
    }
    read(valueAt(here.u));
  });

  svg.addEventListener("pointerup", (event) => {
    const { band } = figure, begun = start;
    start = null;
    figure.band = null;
    if (begun && band && Math.abs(band.x1 - band.x0) * begun.box.width > DRAG) { zoomTo(band); }
    read(valueAt(placeOf(event).u));
  });

  /** A band over all panels, or a box in one where the drag is tall. */
  function bandOf(from, to) {
    const inside = Math.max(0, Math.min(1, (to.y - from.box.y) / from.box.height));
    const across = Math.max(0, Math.min(1, (to.x - from.box.x) / from.box.width));
    const tall = Math.abs(inside - from.v) * from.box.height > TALL;
    return { x0: from.u, x1: across, ...(tall ? { i: from.box.i, y0: from.v, y1: inside } : {}) };
  }

  function zoomTo(band) {
    const [x0, x1] = [band.x0, band.x1].sort((a, b) => a - b), [from, to] = [valueAt(x0), valueAt(x1)];
    if (band.i !== undefined) {
      const [bottom, top] = figure.boxes[band.i].range, at = (v) => top - v * (top - bottom);
      figure.chosen[band.i] = [band.y0, band.y1].map(at).sort((a, b) => a - b);
    }
    figure.view(from, to);
  }

  function leave(event) {
    start = null;
    figure.band = null;
    if (event.pointerType !== "touch") { figure.reading = null; }  // a finger that is lifted leaves its values
    figure.reread();
  }
  svg.addEventListener("pointerleave", leave);
  svg.addEventListener("pointercancel", leave);
  svg.addEventListener("dblclick", () => figure.reset());
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) { return; }  // the page scrolls
    event.preventDefault();
    read(valueAt(placeOf(event).u));
    figure.zoom(event.deltaY > 0 ? 1.25 : 0.8);
  }, { passive: false });

  svg.addEventListener("keydown", (event) => {
    const step = categories ? 1 : (figure.high - figure.low) / (event.shiftKey ? 20 : 200);
    const now = figure.reading === null ? (figure.low + figure.high) / 2 : figure.reading;
    const keys = {
      ArrowLeft: () => read(Math.max(figure.low, now - step)),
      ArrowRight: () => read(Math.min(figure.high, now + step)),
      "+": () => figure.zoom(0.5), "=": () => figure.zoom(0.5), "-": () => figure.zoom(2), 0: () => figure.reset(),
    };
    if (keys[event.key]) {
      event.preventDefault();
      keys[event.key]();
    }
  });
}
