"use strict";
(() => {
  const plots = JSON.parse(document.getElementById("plots").textContent);
  const GAP = -32768;
  const decode = (text) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    const view = new DataView(bytes.buffer), levels = new Int16Array(bytes.length / 2);
    for (let i = 0; i < levels.length; i++) levels[i] = view.getInt16(2 * i, true);
    return levels;
  };
  // the lowest and highest level of the buckets from a to b; null where all of them are gaps
  const extremes = (series, a, b) => {
    let low = 32768, high = GAP;
    for (let i = a; i < b; i++) {
      if (series.low[i] === GAP) continue;
      if (series.low[i] < low) low = series.low[i];
      if (series.high[i] > high) high = series.high[i];
    }
    return low > high ? null : [low * series.scale + series.offset, high * series.scale + series.offset];
  };
  const ticks = (low, high, most) => {
    const span = high - low || 1;
    let step = 10 ** Math.floor(Math.log10(span / most));
    for (const m of [1, 2, 5, 10]) if (span / (m * step) <= most) { step *= m; break; }
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * span; k++) found.push(k * step);
    return found;
  };
  // as the drawings are printed: 6e+9 leaves room for the axis' name, 6000000000 does not
  const label = (v) => {
    const n = Number(v.toPrecision(6));
    return n && (Math.abs(n) >= 1e6 || Math.abs(n) < 1e-4) ? n.toExponential() : String(n);
  };
  const canvases = [];

  class Plot {
    constructor(canvas, plot) {
      this.canvas = canvas;
      this.plot = plot;
      this.view = [0, plot.count];
      canvases.push(this);
      canvas.addEventListener("wheel", (e) => { e.preventDefault(); this.zoom(this.at(e), e.deltaY > 0 ? 1.25 : 0.8); }, { passive: false });
      canvas.addEventListener("dblclick", () => this.show(0, plot.count));
      canvas.addEventListener("pointerdown", (e) => { this.held = e.clientX; canvas.setPointerCapture(e.pointerId); });
      canvas.addEventListener("pointerup", () => { this.held = undefined; });
      canvas.addEventListener("pointermove", (e) => {
        if (this.held === undefined) return;
        this.move((this.held - e.clientX) / this.width());
        this.held = e.clientX;
      });
      canvas.addEventListener("keydown", (e) => {
        const middle = (this.view[0] + this.view[1]) / 2;
        const act = { "+": () => this.zoom(middle, 0.7), "-": () => this.zoom(middle, 1.4), ArrowLeft: () => this.move(-0.15),
          ArrowRight: () => this.move(0.15), Home: () => this.show(0, plot.count) }[e.key];
        if (act) { e.preventDefault(); act(); }
      });
    }
    load() {
      if (this.loaded) return;
      this.loaded = true;
      for (const s of this.plot.series) {
        s.low = decode(s.low);
        s.high = s.high === undefined ? s.low : decode(s.high);
      }
    }
    width() { return this.canvas.clientWidth - 90; }
    at(event) {
      const share = (event.clientX - this.canvas.getBoundingClientRect().left - 76) / this.width();
      return this.view[0] + share * (this.view[1] - this.view[0]);
    }
    zoom(about, factor) { this.show(about + (this.view[0] - about) * factor, about + (this.view[1] - about) * factor); }
    move(share) {
      const length = this.view[1] - this.view[0];
      const start = Math.min(Math.max(0, this.view[0] + share * length), this.plot.count - length);
      this.show(start, start + length);
    }
    show(start, stop) {
      const length = Math.min(Math.max(stop - start, 8), this.plot.count);
      const from = Math.min(Math.max(0, start), this.plot.count - length);
      // plots on the same samples move together
      for (const other of canvases) {
        const same = other.plot.count === this.plot.count && other.plot.step === this.plot.step && other.plot.start === this.plot.start;
        if (other === this || same) { other.view = [from, from + length]; other.later(); }
      }
    }
    later() {
      if (this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => { this.waiting = false; this.draw(); });
    }
    draw() {
      const box = this.canvas.getBoundingClientRect();
      if (!box.width) return;
      this.load();
      const ratio = window.devicePixelRatio || 1, W = box.width, H = box.height;
      this.canvas.width = Math.round(W * ratio);
      this.canvas.height = Math.round(H * ratio);
      const pen = this.canvas.getContext("2d");
      pen.scale(ratio, ratio);
      const style = getComputedStyle(document.documentElement);
      const colour = (name) => style.getPropertyValue("--" + name).trim();
      const left = 76, right = 14, top = 24, bottom = 34, w = W - left - right, h = H - top - bottom;
      const [a, b] = this.view, plot = this.plot;
      let low = Infinity, high = -Infinity;
      for (const s of plot.series) {
        const e = extremes(s, Math.max(0, Math.floor(a / s.step)), Math.min(s.low.length, Math.ceil(b / s.step)));
        if (e) { low = Math.min(low, e[0]); high = Math.max(high, e[1]); }
      }
      if (low > high) { low = -1; high = 1; }
      const margin = 0.05 * (high - low) || 1;
      low -= margin; high += margin;
      const X = (k) => left + (k - a) / (b - a) * w, Y = (v) => top + (high - v) / (high - low) * h;
      pen.font = "11px system-ui, 'DejaVu Sans', sans-serif";
      pen.lineWidth = 0.6;
      pen.strokeStyle = colour("rule");
      pen.fillStyle = colour("faint");
      const t0 = plot.start + a * plot.step, t1 = plot.start + b * plot.step;
      pen.textAlign = "center";
      for (const t of ticks(t0, t1, 9)) {
        const x = left + (t - t0) / (t1 - t0) * w;
        pen.beginPath(); pen.moveTo(x, top); pen.lineTo(x, top + h); pen.stroke();
        pen.fillText(label(t), x, top + h + 14);
      }
      pen.fillText("time in s", left + w / 2, H - 5);
      pen.textAlign = "right";
      for (const v of ticks(low, high, 6)) {
        pen.beginPath(); pen.moveTo(left, Y(v)); pen.lineTo(left + w, Y(v)); pen.stroke();
        pen.fillText(label(v), left - 6, Y(v) + 4);
      }
      pen.save();
      pen.translate(12, top + h / 2);
      pen.rotate(-Math.PI / 2);
      pen.textAlign = "center";
      pen.fillText(plot.unit, 0, 0);
      pen.restore();
      let at = left;
      for (const s of plot.series) {
        pen.strokeStyle = pen.fillStyle = colour(s.kind);
        pen.lineWidth = s.kind === "measured" ? 2.4 : 1.1;
        pen.fillRect(at, 9, 18, 3);
        pen.textAlign = "left";
        pen.fillText(s.name, at + 23, 15);
        at += 40 + pen.measureText(s.name).width;
        this.line(pen, s, a, b, w, X, Y);
      }
    }
    line(pen, s, a, b, w, X, Y) {
      const first = Math.max(0, Math.floor(a / s.step) - 1), last = Math.min(s.low.length, Math.ceil(b / s.step) + 1);
      pen.save();
      pen.beginPath();
      pen.rect(76, 24, w, this.canvas.clientHeight - 58);
      pen.clip();
      pen.beginPath();
      const perPixel = Math.max(1, Math.floor((last - first) / w));
      let open = false;
      for (let i = first; i < last; i += perPixel) {
        const e = extremes(s, i, Math.min(last, i + perPixel));
        if (!e) { open = false; continue; }
        const x = X((i + 0.5 * (perPixel - 1)) * s.step);
        if (open) pen.lineTo(x, Y(e[0])); else pen.moveTo(x, Y(e[0]));
        if (e[1] > e[0]) pen.lineTo(x, Y(e[1]));
        open = true;
      }
      pen.stroke();
      pen.restore();
    }
  }
  for (const canvas of document.querySelectorAll("canvas[data-plot]")) new Plot(canvas, plots[Number(canvas.dataset.plot)]);
  const all = () => canvases.forEach((p) => p.draw());
  // what is out of sight is drawn when it comes into sight
  const seen = new IntersectionObserver((entries) => {
    for (const e of entries) if (e.isIntersecting) canvases.find((p) => p.canvas === e.target).later();
  }, { rootMargin: "400px" });
  canvases.forEach((p) => seen.observe(p.canvas));
  window.addEventListener("resize", all);
  window.addEventListener("beforeprint", all);
  window.addEventListener("afterprint", all);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  document.documentElement.dataset.ready = "yes";
})();
