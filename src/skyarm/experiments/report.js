(function () {
  "use strict";
  function draw(holder) {
    if (holder.dataset.drawn) { return; }
    holder.dataset.drawn = "yes";
    var spec = JSON.parse(document.getElementById(holder.dataset.plot).textContent);
    // the page stays on this computer: no logo that links away, no button that uploads the chart
    Plotly.newPlot(holder, spec.data, spec.layout, {
      responsive: true, displaylogo: false, showLink: false, showSendToCloud: false, plotlyServerURL: "",
      modeBarButtonsToRemove: ["sendDataToCloud", "sendChartToCloud", "select2d", "lasso2d", "autoScale2d",
        "zoomIn2d", "zoomOut2d", "resetCameraLastSave3d", "tableRotation"]
    });
  }
  // one plot per turn, so that the page answers while it draws; what is looked at comes first
  var holders = Array.prototype.slice.call(document.querySelectorAll("[data-plot]"));
  function next() {
    var holder = holders.shift();
    if (holder) { draw(holder); window.setTimeout(next, 0); }
  }
  if ("IntersectionObserver" in window) {
    var watcher = new IntersectionObserver(function (entries) {
      entries.forEach(function (entry) {
        if (entry.isIntersecting) { watcher.unobserve(entry.target); draw(entry.target); }
      });
    });
    holders.forEach(function (holder) { watcher.observe(holder); });
  }
  window.setTimeout(next, 0);
}());
