"use strict";

/** An SVG element with attributes. */
function shape(name, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Axes with round numbers, and what is drawn over them. */
class Chart {
  constructor(svg, xUnit, yUnit) {
    Object.assign(this, { svg, xUnit, yUnit, left: 52, top: 8, width: 412, height: 186 });
  }

  clear() {
    this.svg.replaceChildren();
  }

  /** Clears it and draws the axes: `x` and `y` are [least, most], `xStep` the distance of the vertical lines. */
  begin([xLow, xHigh], yRange, xStep) {
    const [yLow, yHigh] = Chart.roomy(yRange);
    Object.assign(this, { xLow, xHigh, yLow, yHigh });
    const { left, top, width, height } = this;
    const parts = [shape("rect", { class: "frame", x: left, y: top, width, height })];
    for (let x = Math.ceil(xLow / xStep) * xStep; x <= xHigh; x += xStep) {
      parts.push(shape("line", { class: "grid", x1: this.x(x), x2: this.x(x), y1: top, y2: top + height }));
      parts.push(shape("text", { class: "x", x: this.x(x), y: top + height + 14 }, x));
    }
    const yStep = Chart.step(yHigh - yLow);
    const decimals = Math.max(0, -Math.floor(Math.log10(yStep)));
    for (let n = Math.ceil(yLow / yStep); n * yStep <= yHigh; n += 1) {
      const y = this.y(n * yStep);
      parts.push(shape("line", { class: "grid", x1: left, x2: left + width, y1: y, y2: y }));
      parts.push(shape("text", { class: "y", x: left - 6, y: y + 4 }, (n * yStep).toFixed(decimals)));
    }
    parts.push(shape("text", { class: "x", x: left + width / 2, y: top + height + 30 }, `${this.yUnit} against ${this.xUnit}`));
    this.svg.replaceChildren(...parts);
  }

  static roomy([low, high]) {
    if (!(low <= high)) return [-1, 1];
    const room = Math.max(0.08 * (high - low), 0.02);
    return [low - room, high + room];
  }

  /** 1, 2 or 5 times a power of ten, so that four to ten of them are in the range. */
  static step(range) {
    const power = 10 ** Math.floor(Math.log10(range));
    return [0.1, 0.2, 0.5].map((part) => part * power).find((step) => range / step <= 8) ?? power;
  }

  x(value) {
    return this.left + (this.width * (value - this.xLow)) / (this.xHigh - this.xLow);
  }

  /** What is beyond the axis is drawn at its end. */
  y(value) {
    const part = (value - this.yLow) / (this.yHigh - this.yLow);
    return this.top + this.height * (1 - Math.min(Math.max(part, 0), 1));
  }

  dots(points, kind, radius) {
    for (const [x, y] of points) this.svg.append(shape("circle", { class: kind, cx: this.x(x), cy: this.y(y), r: radius }));
  }

  curve(points, kind) {
    const path = points.map(([x, y]) => `${this.x(x).toFixed(2)} ${this.y(y).toFixed(2)}`).join("L");
    if (path) this.svg.append(shape("path", { class: kind, d: `M${path}` }));
  }
}
