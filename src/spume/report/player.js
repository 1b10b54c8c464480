"use strict";
// One clock and one set of controls for the views of all runs.

class Player {
  constructor(views, ranges) {
    this.views = views;
    this.ranges = ranges;
    // The run with the most frames says where the slider can stop.
    this.times = views.reduce((most, view) => (view.times.length > most.length ? view.times : most), []);
    this.end = Math.max(...views.map((view) => view.times[view.times.length - 1]));
    this.frame = 0;
    this.time = this.times[0];
    this.playing = false;
    this.active = views[0];
    this.find = (id) => document.getElementById(id);
    for (const view of views) {
      view.ranges = ranges;
      this.listen(view);
    }
    this.controls();
    this.colour();
    this.fit();
    this.show();
  }

  controls() {
    const { find } = this;
    const scrub = find("scrub");
    scrub.max = this.times.length - 1;
    scrub.addEventListener("input", () => {
      this.pause();
      this.seek(Number(scrub.value));
    });
    find("play").addEventListener("click", () => this.toggle());
    find("colour").addEventListener("change", () => this.colour());
    for (const name of ["walls", "extreme"]) {
      find(name).addEventListener("change", (event) => {
        for (const view of this.views) view.options[name] = event.target.checked;
        this.show();
      });
    }
    find("closer").addEventListener("click", () => this.each((view) => view.magnify(1.25)));
    find("farther").addEventListener("click", () => this.each((view) => view.magnify(0.8)));
    find("reset").addEventListener("click", () => this.each((view) => view.reset()));
    new ResizeObserver(() => this.fit()).observe(this.views[0].canvas.parentElement);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.fit(true));
  }

  each(change) {
    this.views.forEach(change);
    this.show();
  }

  fit(anew = false) {
    for (const view of this.views) if (view.resize() || anew) view.theme();
    this.show();
  }

  colour() {
    const name = this.find("colour").value;
    for (const view of this.views) view.options.colour = name;
    const ends = this.ranges[name];
    this.find("scale").hidden = !ends;
    this.find("legend").hidden = Boolean(ends);
    this.find("extreme").disabled = !ends;
    if (ends) {
      this.find("low").textContent = shortNumber(ends[0], 3);
      this.find("middle").textContent = shortNumber((ends[0] + ends[1]) / 2, 3);
      this.find("high").textContent = shortNumber(ends[1], 3);
      this.find("quantity").textContent = { pressure: "pressure [Pa]", speed: "speed [m/s]" }[name];
    } else {
      for (const list of this.find("legend").children) list.hidden = list.dataset.of !== name;
    }
    this.show();
  }

  /** Draw the state of `time`, `share` of the way from a frame to the next where it plays. */
  show(share = 0) {
    for (const view of this.views) {
      const [frame, part] = this.within(view.times, share);
      view.draw(frame, part);
    }
    this.find("scrub").value = this.frame;
    this.find("scrub").setAttribute("aria-valuetext", `${this.time.toPrecision(4)} s`);
    this.find("clock").textContent = `t = ${this.time.toFixed(3)} s, frame ${this.frame + 1} of ${this.times.length}`;
    this.tell();
  }

  within(times, share) {
    let frame = 0;
    while (frame + 1 < times.length && times[frame + 1] <= this.time + 1e-9) frame++;
    if (!share || frame + 1 >= times.length) {
      const near = frame + 1 < times.length && times[frame + 1] - this.time < this.time - times[frame] ? frame + 1 : frame;
      return [near, 0];
    }
    return [frame, Math.max(0, Math.min(1, (this.time - times[frame]) / (times[frame + 1] - times[frame])))];
  }

  tell() {
    const view = this.active, lines = [];
    if (view.selected >= 0) lines.push(`chosen: ${view.described(view.selected)}`);
    if (view.options.extreme && view.largest >= 0) {
      lines.push(`largest ${view.options.colour}: ${view.described(view.largest)}`);
    }
    const name = this.views.length > 1 ? `${view.name}: ` : "";
    const text = lines.map((line) => name + line).join("\n");
    if (this.find("told").textContent !== text) this.find("told").textContent = text;
  }

  seek(frame) {
    this.frame = Math.max(0, Math.min(this.times.length - 1, frame));
    this.time = this.times[this.frame];
    this.show();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.time >= this.end - 1e-9) this.time = this.times[0];
    this.playing = true;
    this.label();
    let last = null;
    const tick = (now) => {
      if (!this.playing) return;
      if (last !== null) this.time += Math.min(0.25, (now - last) / 1000) * Number(this.find("rate").value) * this.pace();
      last = now;
      if (this.time >= this.end) {
        this.time = this.end;
        this.frame = this.times.length - 1;
        this.pause();
        return;
      }
      this.frame = this.within(this.times, 0)[0];
      this.show(1);
      for (const view of this.views) view.adapt(true);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  /** Simulated seconds per second at the usual rate: the whole run in eight seconds. */
  pace() {
    return Math.max(this.end - this.times[0], 1e-12) / 8;
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.label();
    for (const view of this.views) view.adapt(false);
    this.seek(this.frame);
  }

  label() {
    this.find("play").textContent = this.playing ? "❚❚ Pause" : "▶ Play";
    this.find("play").setAttribute("aria-pressed", String(this.playing));
  }

  listen(view) {
    const canvas = view.canvas, down = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, [event.clientX, event.clientY]);
      moved = 0;
      this.active = view;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
      moved += Math.abs(dx) + Math.abs(dy);
      down.set(event.pointerId, now);
      for (const each of this.views) each.adapt(true);
      if (down.size === 2) {
        const [a, b] = [...down.values()], other = a === now ? b : a;
        const gain = Math.hypot(now[0] - other[0], now[1] - other[1]) / Math.hypot(before[0] - other[0], before[1] - other[1]);
        if (Number.isFinite(gain) && gain > 0) view.magnify(gain, (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
        view.pan(dx / 2, dy / 2);
      } else if (view.dimension === 2 || event.shiftKey || event.buttons === 2) view.pan(dx, dy);
      else view.orbit(dx, dy);
      this.turned(view);
    });
    const up = (event) => {
      if (down.has(event.pointerId) && moved < 6 && event.type === "pointerup") {
        view.selected = view.pick(event.clientX, event.clientY);
        this.show();
      }
      down.delete(event.pointerId);
      if (!down.size && moved && !this.playing) {
        for (const each of this.views) each.adapt(false);
        this.show();
      }
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (document.activeElement !== canvas && !event.ctrlKey) return; // the page scrolls
        event.preventDefault();
        view.magnify(Math.exp(-0.0015 * event.deltaY), event.clientX, event.clientY);
        this.turned(view);
      },
      { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event, view));
  }

  /** Runs of one dimension are looked at from the same side, each at its own place. */
  turned(view) {
    for (const other of this.views) {
      if (other !== view && other.dimension === view.dimension) {
        other.azimuth = view.azimuth;
        other.height = view.height;
        other.zoom = view.zoom;
        other.middle = other.middle.map((_, k) => (
          view.middle[k] - 0.5 * (view.known.lower[k] + view.known.upper[k]) + 0.5 * (other.known.lower[k] + other.known.upper[k])) || 0);
      }
    }
    if (!this.playing) this.show();
  }

  key(event, view) {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    this.active = view;
    if (event.key === " ") this.toggle();
    else if (event.key === "+" || event.key === "=") view.magnify(1.25);
    else if (event.key === "-") view.magnify(0.8);
    else if (event.key === "0") view.reset();
    else if (event.key === "," || event.key === ".") {
      this.pause();
      this.seek(this.frame + (event.key === "." ? 1 : -1));
    } else if (move && view.dimension === 3 && !event.shiftKey) view.orbit(-15 * move[0], 15 * -move[1]);
    else if (move) view.pan(-30 * move[0], -30 * move[1]);
    else return;
    event.preventDefault();
    this.turned(view);
  }
}
