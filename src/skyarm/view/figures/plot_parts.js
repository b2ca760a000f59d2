"use strict";
// Parts that both kinds of figures are made of: elements, ticks, numbers, the bar of buttons above a figure.

const SVG = "http://www.w3.org/2000/svg";
const SAMPLE = "M0 5H26";

/** Make an element of a page, with attributes and text, inside a parent. */
function made(name, attributes, parent, text) {
  return filled(document.createElement(name), attributes, parent, text);
}

/** Make an element of a drawing. */
function drawn(name, attributes, parent, text) {
  return filled(document.createElementNS(SVG, name), attributes, parent, text);
}

function filled(element, attributes, parent, text) {
  Object.keys(attributes || {}).forEach((key) => element.setAttribute(key, attributes[key]));
  if (text !== undefined) { element.textContent = text; }
  if (parent) { parent.appendChild(element); }
  return element;
}

/** Round numbers of an axis, with their texts: steps of 1, 2 or 5 times a power of ten, `count` of them or fewer. */
function ticks(low, high, count) {
  const least = (high - low) / count, power = Math.pow(10, Math.floor(Math.log10(least)));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= least * (1 - 1e-9));
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i += 1) {
    found.push({ at: i * step, text: (i === 0 ? 0 : i * step).toFixed(Math.min(digits, 12)).replace("-", "\u2212") });
  }
  return found;
}

/** A value as it is read out. */
function readable(value) {
  if (value === null || value === undefined) { return "\u2013"; }
  const small = value !== 0 && Math.abs(value) < 1e-3;
  return (small ? value.toExponential(2) : value.toFixed(4)).replace(/-/g, "\u2212");
}

/** Names of the curves in their order, each with the style of its line and whether it is shown. */
function legendOf(spec) {
  const found = new Map();
  spec.curves.forEach((curve) => {
    if (!found.has(curve.name)) { found.set(curve.name, { style: curve.style, shown: curve.shown }); }
  });
  return found;
}

/**
 * The bar above a figure: a button for each curve, for each choice of curves, for each tool.
 * A click on a curve shows or hides it, a double click shows it alone.
 */
function bar(holder, spec, legend, tools, changed) {
  const box = made("div", { class: "plot-bar" }, holder), buttons = new Map();
  function show(wanted) {
    legend.forEach((entry, name) => {
      entry.shown = wanted(name, entry);
      buttons.get(name).setAttribute("aria-pressed", String(entry.shown));
    });
    changed();
  }
  const names = made("div", { class: "plot-legend", role: "group", "aria-label": "Curves" }, box);
  legend.forEach((entry, name) => {
    const button = made("button", { type: "button", "aria-pressed": String(entry.shown), class: entry.style }, names);
    button.title = "Click: show or hide; double click: show alone";
    const sample = drawn("svg", { width: 26, height: 10, "aria-hidden": "true" }, button);
    drawn("path", { d: SAMPLE, class: "curve" }, sample);
    made("span", {}, button, name);
    buttons.set(name, button);
    button.addEventListener("click", () => show((other, each) => (other === name ? !each.shown : each.shown)));
    button.addEventListener("dblclick", () => show((other) => other === name));
  });
  (spec.shades || []).forEach((shade) => made("span", { class: "plot-shade " + shade.name }, names, shade.name));
  const rest = made("div", { class: "plot-tools", role: "group", "aria-label": "View" }, box);
  (spec.choices || []).forEach((choice) => {
    const button = made("button", { type: "button" }, rest, choice.label);
    button.addEventListener("click", () => show((name) => choice.names.includes(name)));
  });
  tools.forEach((tool) => {
    const button = made("button", { type: "button", title: tool.title, "aria-label": tool.title }, rest, tool.label);
    button.addEventListener("click", tool.act);
  });
}

/** Save a drawing as a file of its own, with the page's styles for it. */
function save(svg, name) {
  const copy = svg.cloneNode(true), style = document.getElementById("plot-style");
  copy.setAttribute("xmlns", SVG);
  copy.setAttribute("class", "plot");
  copy.insertBefore(drawn("style", {}, null, style ? style.textContent : ""), copy.firstChild);
  const link = made("a", { download: name + ".svg" });
  link.href = URL.createObjectURL(new Blob([new XMLSerializer().serializeToString(copy)], { type: "image/svg+xml" }));
  link.click();
  window.setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Do something once per picture, however often it is asked for. */
function oncePerPicture(work) {
  let asked = false;
  return () => {
    if (asked) { return; }
    asked = true;
    window.requestAnimationFrame(() => { asked = false; work(); });
  };
}
