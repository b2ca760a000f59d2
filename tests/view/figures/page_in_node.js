"use strict";
// A page of figures in Node: a document that holds elements and hears events, and no more. Reads from standard input
// {script, specs, width, actions}, draws every specification, runs the actions, prints what they give back as JSON.

const vm = require("vm");

class Element_ {
  constructor(name) {
    Object.assign(this, { name, attributes: {}, children: [], listeners: {}, dataset: {}, own: "", clicks: 0 });
  }

  setAttribute(key, value) { this.attributes[key] = String(value); }
  getAttribute(key) { return key in this.attributes ? this.attributes[key] : null; }
  appendChild(child) { this.children.push(child); return child; }
  insertBefore(child, before) { this.children.splice(Math.max(0, this.children.indexOf(before)), 0, child); }
  get firstChild() { return this.children[0] || null; }
  replaceChildren() { this.children = []; }
  cloneNode() {
    const copy = new Element_(this.name);
    Object.assign(copy, { attributes: { ...this.attributes }, own: this.own });
    copy.children = this.children.map((child) => child.cloneNode());
    return copy;
  }
  set textContent(text) { this.own = String(text); }
  get textContent() { return this.own + this.children.map((child) => child.textContent).join(""); }
  get clientWidth() { return given.width; }
  getBoundingClientRect() { return { left: 0, top: 0, width: Number(this.attributes.width) }; }
  addEventListener(kind, heard) { (this.listeners[kind] = this.listeners[kind] || []).push(heard); }
  fire(kind, event) {
    const whole = { button: 0, pointerId: 1, prevented: false, preventDefault() { this.prevented = true; }, ...event };
    (this.listeners[kind] || []).forEach((heard) => heard(whole));
    return whole;
  }
  click() { this.clicks += 1; this.fire("click"); }
  all(test) { return this.children.flatMap((each) => [...(test(each) ? [each] : []), ...each.all(test)]); }
  /** Elements below of a name, or of a class. */
  find(name) {
    return this.all((each) => each.name === name || (each.attributes.class || "").split(" ").includes(name));
  }
}

const given = JSON.parse(require("fs").readFileSync(0, "utf8"));
const holders = Object.keys(given.specs).map((name) => {
  const holder = new Element_("div");
  holder.dataset.plot = name;
  holder.setAttribute("aria-label", `about ${name}`);
  return holder;
});
const saved = [], resized = [];
const data = Object.fromEntries(Object.entries(given.specs).map(([name, text]) => [name, { textContent: text }]));

Object.assign(globalThis, {
  document: {
    createElement: (name) => new Element_(name),
    createElementNS: (space, name) => Object.assign(new Element_(name), { space }),
    getElementById: (name) => data[name] || (name === "plot-style" ? { textContent: ".curve {}" } : null),
    querySelectorAll: (selector) => (selector === "[data-plot]" ? holders : []),
  },
  window: {
    setTimeout: (work) => work(),
    requestAnimationFrame: (work) => work(),
    addEventListener: (kind, heard) => { if (kind === "resize") { resized.push(heard); } },
  },
  XMLSerializer: class {
    serializeToString(element) {
      const held = Object.entries(element.attributes).map(([key, value]) => ` ${key}="${value}"`).join("");
      const inside = element.own + element.children.map((child) => this.serializeToString(child)).join("");
      return `<${element.name}${held}>${inside}</${element.name}>`;
    }
  },
  Blob: class { constructor(parts, kind) { saved.push([parts.join(""), kind.type]); } },
  holders, saved, given, resize: (width) => { given.width = width; resized.forEach((heard) => heard()); },
});
URL.createObjectURL = () => "blob:drawing";
URL.revokeObjectURL = () => undefined;

vm.runInThisContext(given.script);
console.log(JSON.stringify(vm.runInThisContext(`(function () { ${given.actions} }())`)));
