"use strict";
// Every holder of the page gets its figure: what is looked at first, one per turn, so that the page answers meanwhile.

(function () {
  const figures = [];
  function draw(holder) {
    if (holder.dataset.drawn) { return; }
    holder.dataset.drawn = "yes";
    const spec = JSON.parse(document.getElementById(holder.dataset.plot).textContent);
    figures.push(spec.kind === "path" ? new PathFigure(holder, spec) : new PanelsFigure(holder, spec));
  }
  const holders = Array.from(document.querySelectorAll("[data-plot]")), left = holders.slice();
  function next() {
    const holder = left.shift();
    if (holder) {
      draw(holder);
      window.setTimeout(next, 0);
    }
  }
  if ("IntersectionObserver" in window) {
    const watcher = new IntersectionObserver((entries) => entries.forEach((entry) => {
      if (entry.isIntersecting) {
        watcher.unobserve(entry.target);
        draw(entry.target);
      }
    }));
    holders.forEach((holder) => watcher.observe(holder));
  }
  window.addEventListener("resize", () => figures.forEach((figure) => figure.redraw()));
  window.setTimeout(next, 0);
}());
