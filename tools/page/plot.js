"use strict";
// Draws the axes of a figure (docs/report.md, "Data of the page") on canvases: as wide as there is room, in the page's
// colours, with the values under the pointer in words.
const Plot = (() => {
  const LEFT = 62, RIGHT = 14, TOP = 8, BOTTOM = 44, BAR = 84;
  const TICK_PX = 80, HEAD_ROOM = 0.08, PADDING = 0.05;
  const FONT = "12px system-ui, sans-serif";

  const finite = (v) => v !== null && Number.isFinite(v);

  function rangeOf(lists) {
    let low = Infinity, high = -Infinity;
    for (const list of lists) {
      for (const v of list) {
        if (finite(v)) {
          low = Math.min(low, v);
          high = Math.max(high, v);
        }
      }
    }
    if (low > high) return [0, 1];
    if (low === high) {
      const half = low === 0 ? 0.5 : Math.abs(low) / 2;
      return [low - half, high + half];
    }
    return [low, high];
  }

  const widened = ([low, high], fraction) => [low - fraction * (high - low), high + fraction * (high - low)];

  // Round values (1, 2 or 5 times a power of ten apart) within a range, about `count` of them, with their labels.
  function ticks([low, high], count) {
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999999);
    const digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    const list = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; ++i) {
      const value = i * step;
      const plain = Math.abs(value) < 1e6 && digits <= 6;
      list.push([value, plain ? value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1") : value.toPrecision(3)]);
    }
    return list;
  }

  // Where data lies on a canvas of this size.
  function mapping(axes, width, height) {
    const values = axes.series.some((s) => s.values);
    const box = {x: LEFT, y: TOP, w: Math.max(10, width - LEFT - RIGHT - (values ? BAR : 0)), h: height - TOP - BOTTOM};
    let xr = rangeOf(axes.series.map((s) => s.x));
    let yr = rangeOf(axes.series.map((s) => s.y));
    const top = yr[1];
    yr = widened(yr, PADDING);
    if (axes.from_zero && top > 0) yr = [0, top * (1 + HEAD_ROOM)];
    if (axes.equal) {
      xr = widened(xr, PADDING);
      const unit = Math.min(box.w / (xr[1] - xr[0]), box.h / (yr[1] - yr[0]));
      xr = widened(xr, (box.w / unit / (xr[1] - xr[0]) - 1) / 2);
      yr = widened(yr, (box.h / unit / (yr[1] - yr[0]) - 1) / 2);
    }
    return {
      box, xr, yr, values: values ? rangeOf(axes.series.filter((s) => s.values).map((s) => s.values)) : null,
      x: (v) => box.x + (v - xr[0]) / (xr[1] - xr[0]) * box.w,
      y: (v) => box.y + box.h - (v - yr[0]) / (yr[1] - yr[0]) * box.h,
    };
  }

  function theme(element) {
    const style = getComputedStyle(element);
    const get = (name) => style.getPropertyValue(name).trim();
    return {text: get("--text"), faint: get("--grid"), frame: get("--muted"), dark: get("--scheme") === "dark"};
  }

  // Colours are chosen for white; on black they are lighter.
  function shade(color, dark) {
    const mix = (v) => Math.round(255 * (dark ? v + (1 - v) * 0.3 : v));
    return `rgb(${color.map(mix).join(" ")})`;
  }

  function drawFrame(g, axes, m, t) {
    const {box} = m;
    g.font = FONT;
    g.fillStyle = t.text;
    g.lineWidth = 1;
    g.strokeStyle = t.faint;
    g.textAlign = "center";
    g.textBaseline = "top";
    for (const [value, label] of ticks(m.xr, Math.max(2, Math.floor(box.w / TICK_PX)))) {
      g.beginPath();
      g.moveTo(m.x(value), box.y);
      g.lineTo(m.x(value), box.y + box.h);
      g.stroke();
      g.fillText(label, m.x(value), box.y + box.h + 6);
    }
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const [value, label] of ticks(m.yr, Math.max(2, Math.floor(box.h / 40)))) {
      g.beginPath();
      g.moveTo(box.x, m.y(value));
      g.lineTo(box.x + box.w, m.y(value));
      g.stroke();
      g.fillText(label, box.x - 6, m.y(value));
    }
    g.textAlign = "center";
    g.textBaseline = "bottom";
    g.fillText(axes.x_label, box.x + box.w / 2, box.y + box.h + BOTTOM - 4);
    upwards(g, axes.y_label, 12, box.y + box.h / 2);
  }

  function upwards(g, text, x, y) {
    g.save();
    g.translate(x, y);
    g.rotate(-Math.PI / 2);
    g.textAlign = "center";
    g.textBaseline = "middle";
    g.fillText(text, 0, 0);
    g.restore();
  }

  function drawLine(g, s, m, t) {
    g.strokeStyle = shade(s.color, t.dark);
    g.lineWidth = s.width;
    g.setLineDash(s.dashed ? [6, 4] : []);
    g.beginPath();
    let down = false;
    for (let i = 0; i < s.x.length; ++i) {
      if (!finite(s.x[i]) || !finite(s.y[i])) {
        down = false;
      } else if (down) {
        g.lineTo(m.x(s.x[i]), m.y(s.y[i]));
      } else {
        g.moveTo(m.x(s.x[i]), m.y(s.y[i]));
        down = true;
      }
    }
    g.stroke();
    g.setLineDash([]);
  }

  const mapped = (colors, [low, high], v) => colors[Math.round((v - low) / (high - low) * (colors.length - 1))];

  function drawColored(g, s, m, t, colors) {
    g.lineWidth = s.width;
    for (let i = 1; i < s.x.length; ++i) {
      if ([s.x[i - 1], s.y[i - 1], s.x[i], s.y[i], s.values[i]].every(finite)) {
        g.strokeStyle = shade(mapped(colors, m.values, s.values[i]), t.dark);
        g.beginPath();
        g.moveTo(m.x(s.x[i - 1]), m.y(s.y[i - 1]));
        g.lineTo(m.x(s.x[i]), m.y(s.y[i]));
        g.stroke();
      }
    }
  }

  function drawBar(g, axes, m, t, colors) {
    const {box} = m;
    const x = box.x + box.w + 12;
    const piece = box.h / colors.length;
    colors.forEach((color, i) => {
      g.fillStyle = shade(color, t.dark);
      g.fillRect(x, box.y + box.h - (i + 1) * piece, 12, piece + 0.5);
    });
    g.fillStyle = t.text;
    g.textAlign = "left";
    g.textBaseline = "middle";
    for (const [value, label] of ticks(m.values, Math.max(2, Math.floor(box.h / 40)))) {
      g.fillText(label, x + 16, box.y + box.h * (1 - (value - m.values[0]) / (m.values[1] - m.values[0])));
    }
    upwards(g, axes.value_label, x + 64, box.y + box.h / 2);
  }

  function draw(canvas, axes, colors) {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    const t = theme(canvas);
    const m = mapping(axes, width, height);
    drawFrame(g, axes, m, t);
    g.save();
    g.beginPath();
    g.rect(m.box.x, m.box.y, m.box.w, m.box.h);
    g.clip();
    for (const s of axes.series) {
      if (s.values) drawColored(g, s, m, t, colors);
      else drawLine(g, s, m, t);
    }
    g.restore();
    g.strokeStyle = t.frame;
    g.lineWidth = 1;
    g.strokeRect(m.box.x, m.box.y, m.box.w, m.box.h);
    if (m.values) drawBar(g, axes, m, t, colors);
    return m;
  }

  // The point of a series nearest to a place on the canvas: along x, or in both directions where both are lengths.
  function nearest(s, m, px, py, both) {
    let best = null, least = Infinity;
    for (let i = 0; i < s.x.length; ++i) {
      if (finite(s.x[i]) && finite(s.y[i])) {
        const dx = m.x(s.x[i]) - px;
        const far = both ? Math.hypot(dx, m.y(s.y[i]) - py) : Math.abs(dx);
        if (far < least) {
          least = far;
          best = i;
        }
      }
    }
    return best;
  }

  const short = (v) => Number(v.toPrecision(4)).toString();

  function inWords(axes, m, px, py) {
    const parts = [];
    for (const s of axes.series) {
      const i = s.label ? nearest(s, m, px, py, axes.equal) : null;
      if (i !== null) {
        const value = s.values && finite(s.values[i]) ? `, ${axes.value_label} ${short(s.values[i])}` : "";
        parts.push(`${s.label}: (${short(s.x[i])}, ${short(s.y[i])})${value}`);
      }
    }
    return parts.join("   ");
  }

  function element(tag, className, text) {
    const made = document.createElement(tag);
    if (className) made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function legend(axes, colors) {
    const list = element("div", "legend");
    for (const s of axes.series.filter((one) => one.label)) {
      const entry = element("span", "", s.label);
      const sample = element("i", s.dashed ? "dashed" : "");
      sample.style.borderColor = shade(s.color, false);
      if (s.values) {
        const steps = [0, 0.5, 1].map((part) => shade(mapped(colors, [0, 1], part), false));
        sample.style.borderImage = `linear-gradient(90deg, ${steps.join(", ")}) 1`;
      }
      entry.prepend(sample);
      list.append(entry);
    }
    return list;
  }

  // Adds one plot to `parent`; returns a function that draws it again with what `axes` then holds.
  function add(parent, axes, colors) {
    const figure = element("figure", "plot");
    const canvas = element("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${axes.title}: ${axes.y_label} over ${axes.x_label}`);
    const words = element("output", "", "\u00a0");
    figure.append(element("figcaption", "", axes.title), canvas, legend(axes, colors), words);
    parent.append(figure);
    let m = null;
    const redraw = () => {
      if (canvas.clientWidth > 0) m = draw(canvas, axes, colors);
    };
    new ResizeObserver(redraw).observe(canvas);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
    canvas.addEventListener("pointermove", (event) => {
      if (m) words.textContent = inWords(axes, m, event.offsetX, event.offsetY) || "\u00a0";
    });
    canvas.addEventListener("pointerleave", () => {
      words.textContent = "\u00a0";
    });
    return redraw;
  }

  return {add, element};
})();
