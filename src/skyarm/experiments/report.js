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
  var holders = document.querySelectorAll("[data-plot]");
  if (!("IntersectionObserver" in window)) { holders.forEach(draw); return; }
  var watcher = new IntersectionObserver(function (entries) {
    entries.forEach(function (entry) { if (entry.isIntersecting) { watcher.unobserve(entry.target); draw(entry.target); } });
  }, { rootMargin: "600px" });
  holders.forEach(function (holder) { watcher.observe(holder); });
}());
