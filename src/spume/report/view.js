"use strict";
// Particles of one run: numbers as packed.py stores them, drawn by the processor into a canvas, so that every
// browser shows the same with or without a graphics card.

const STILL = 2e6; // pixels drawn at most; beyond, one of them covers several of the screen
const MOVING = 6e5; // the same while it plays or is turned
const FEWEST = 2.4e5; // where that is too slow
const SLOW = 25; // milliseconds between two pictures
const WORK = 8; // of which drawing takes that many at least, else something else is slow
const SHADES = 8;
const HIDDEN = 65535;
const BUCKETS = 2048; // of distances from the eye
const GREYS = 16; // of walls that look in different directions
const TAU = 2 * Math.PI;

/** Bytes of a script element that holds them compressed, as text. */
async function inflated(id) {
  const text = document.getElementById(id).textContent.trim();
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Codes of a channel, frame after frame; value = low + step * code. */
function decoded(bytes, channel, rows) {
  const count = channel.frames * rows;
  const low = bytes.subarray(channel.offset, channel.offset + count);
  const high = bytes.subarray(channel.offset + count, channel.offset + 2 * count);
  const codes = new Uint16Array(count);
  for (let i = 0; i < count; i++) {
    const stored = low[i] | (high[i] << 8);
    let code = (stored >>> 1) ^ -(stored & 1);
    if (i >= 2 * rows && channel.order === 2) code += 2 * codes[i - rows] - codes[i - 2 * rows];
    else if (i >= rows) code += codes[i - rows];
    codes[i] = code;
  }
  return codes;
}

/** One kind of rows (fluid, wall) with its channels. */
class Group {
  constructor(known, bytes) {
    Object.assign(this, known);
    this.codes = {};
    for (const [name, channel] of Object.entries(known.channels)) {
      this.codes[name] = decoded(bytes, channel, known.rows);
    }
    this.screen = new Float32Array(3 * this.rows); // right and down [pixels], towards the eye [m]
  }
  has(name) {
    return name in this.channels;
  }
  at(name, frame) {
    return (this.channels[name].frames > 1 ? frame : 0) * this.rows;
  }
  value(name, frame, row) {
    const channel = this.channels[name];
    return channel.low + channel.step * this.codes[name][this.at(name, frame) + row];
  }
  absent(frame, row) {
    return this.has("absent") && this.value("absent", frame, row) > 0.5;
  }
  id(row) {
    if (!this.has("gap")) return null;
    let id = this.first_id;
    for (let i = 0; i <= row; i++) id += this.codes.gap[i];
    return id;
  }
}

/** A disc or ball of pixels around a particle: offsets, depths and shades. */
class Stamp {
  constructor(radius, depth, round, dimension) {
    const reach = Math.max(0, Math.floor(radius));
    const dx = [], dy = [], lift = [], shade = [];
    for (let y = -reach; y <= reach; y++) {
      for (let x = -reach; x <= reach; x++) {
        const far = Math.hypot(x, y) / Math.max(radius, 0.5);
        if (far > 1 && (x || y)) continue;
        dx.push(x);
        dy.push(y);
        const height = Math.sqrt(Math.max(0, 1 - far * far));
        lift.push(round ? depth * (dimension === 3 ? height : 1 - far) : 0);
        let light = 1;
        if (round && dimension === 3 && radius > 1.2) {
          light = 0.62 + 0.38 * Math.max(0, (-0.5 * x - 0.55 * y) / Math.max(radius, 1) + 0.67 * height);
        } else if (round && radius > 4) {
          light = 1 - 0.25 * far * far;
        }
        shade.push(Math.min(SHADES - 1, Math.round(light * (SHADES - 1))));
      }
    }
    this.reach = reach;
    this.dx = Int32Array.from(dx);
    this.dy = Int32Array.from(dy);
    this.lift = Float32Array.from(lift);
    this.shade = Uint8Array.from(shade);
    this.length = dx.length;
    this.top = round ? depth : 0;
  }
}

const packedColour = (r, g, b) => (255 << 24) | (b << 16) | (g << 8) | r;

/** Colours in every shade: table[shade * count + colour]. */
function shaded(colours) {
  const count = colours.length / 3;
  const table = new Int32Array(SHADES * count);
  for (let s = 0; s < SHADES; s++) {
    const light = s / (SHADES - 1);
    for (let c = 0; c < count; c++) {
      table[s * count + c] = packedColour(
        Math.round(colours[3 * c] * light), Math.round(colours[3 * c + 1] * light), Math.round(colours[3 * c + 2] * light));
    }
  }
  return { table, count };
}

/** Steps of 1, 2 or 5 times a power of ten, about `wanted` of them in a length. */
function niceStep(length, wanted) {
  const rough = length / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
}

function shortNumber(value, digits = 4) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(digits - 2);
  return String(Number(value.toPrecision(digits)));
}

class View {
  constructor(canvas, known, bytes, maps) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.known = known;
    this.maps = maps;
    this.dimension = known.dimension;
    this.groups = {};
    for (const [name, group] of Object.entries(known.groups)) this.groups[name] = new Group(group, bytes);
    this.times = known.times;
    this.options = { colour: "speed", walls: true, extreme: true };
    this.selected = -1;
    this.frame = 0;
    this.drawn = 0; // pictures so far
    this.most = STILL;
    this.work = this.span = 0; // milliseconds of drawing, and between two pictures, lately
    this.last = null;
    this.reset();
    this.resize();
  }

  reset() {
    this.azimuth = -60;
    this.height = 18;
    this.zoom = 1;
    this.middle = this.known.lower.map((low, k) => 0.5 * (low + this.known.upper[k]));
    if (this.dimension === 2) this.middle[2] = 0;
  }

  /** Fit the canvas to its place on the page; true if its size changed. */
  resize() {
    const box = this.canvas.getBoundingClientRect();
    if (!box.width) return false;
    const ratio = Math.min(window.devicePixelRatio || 1, Math.sqrt(this.most / (box.width * box.height)));
    const width = Math.max(16, Math.round(box.width * ratio)), height = Math.max(16, Math.round(box.height * ratio));
    this.ratio = width / box.width;
    if (width === this.canvas.width && height === this.canvas.height && this.image) return false;
    this.canvas.width = width;
    this.canvas.height = height;
    this.image = this.context.createImageData(width, height);
    this.pixels = new Int32Array(this.image.data.buffer); // signed numbers are faster
    this.depth = new Float32Array(width * height);
    return true;
  }

  theme() {
    const style = getComputedStyle(document.documentElement);
    const rgb = (name) => {
      const hex = style.getPropertyValue(name).trim();
      return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
    };
    this.ink = style.getPropertyValue("--ink").trim();
    this.faint = style.getPropertyValue("--faint").trim();
    this.mark = style.getPropertyValue("--mark").trim();
    this.paper = style.getPropertyValue("--plot").trim();
    this.background = packedColour(...rgb("--plot"));
    const wall = rgb("--wall"), greys = [];
    for (let light = 0; light < GREYS; light++) greys.push(...wall.map((part) => part * (0.76 + (0.24 * light) / (GREYS - 1))));
    this.wallColours = shaded(greys);
    this.font = `${Math.round(12 * this.ratio)}px system-ui, sans-serif`;
  }

  /** Unit vectors to the right, up and towards the eye. */
  axes() {
    if (this.dimension === 2) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const a = (this.azimuth * Math.PI) / 180, h = (this.height * Math.PI) / 180;
    const eye = [Math.cos(h) * Math.cos(a), Math.cos(h) * Math.sin(a), Math.sin(h)];
    const right = [-Math.sin(a), Math.cos(a), 0];
    const up = [
      eye[1] * right[2] - eye[2] * right[1], eye[2] * right[0] - eye[0] * right[2], eye[0] * right[1] - eye[1] * right[0]];
    return [right, up, eye];
  }

  /** Margins of the drawing inside the canvas [pixels]: left, right, top, bottom. */
  margins() {
    const unit = this.ratio;
    return this.dimension === 2 ? [52 * unit, 12 * unit, 22 * unit, 38 * unit] : [8 * unit, 8 * unit, 22 * unit, 40 * unit];
  }

  camera() {
    const [left, right, top, bottom] = this.margins();
    const width = this.canvas.width - left - right, height = this.canvas.height - top - bottom;
    const axes = this.axes();
    const size = [0, 0];
    for (const k of [0, 1]) {
      for (let c = 0; c < this.dimension; c++) {
        size[k] += Math.abs(axes[k][c]) * (this.known.upper[c] - this.known.lower[c]);
      }
      size[k] += 2 * this.known.spacing;
    }
    const scale = this.zoom * Math.min(width / size[0], height / size[1]);
    const centre = axes.map((axis) => axis.reduce((sum, part, c) => sum + part * (this.middle[c] || 0), 0));
    return { axes, scale, centre, x: left + width / 2, y: top + height / 2 };
  }

  /** Positions on the screen; `share` of the way from this frame to the next. */
  project(group, camera, frame, share) {
    const { axes, scale, centre, x, y } = camera;
    const screen = group.screen, rows = group.rows;
    screen.fill(0);
    const names = ["x", "y", "z"].slice(0, this.dimension);
    let shift = [-centre[0], -centre[1], -centre[2]];
    names.forEach((name, c) => {
      const channel = group.channels[name], codes = group.codes[name];
      const now = group.at(name, frame), next = channel.frames > 1 ? Math.min(now + rows, codes.length - rows) : now;
      const a = axes[0][c] * channel.step, b = axes[1][c] * channel.step, e = axes[2][c] * channel.step;
      shift = shift.map((s, k) => s + axes[k][c] * channel.low);
      const still = share === 0 || next === now;
      for (let i = 0, j = 0; i < rows; i++, j += 3) {
        const code = still ? codes[now + i] : codes[now + i] + share * (codes[next + i] - codes[now + i]);
        screen[j] += a * code;
        screen[j + 1] += b * code;
        screen[j + 2] += e * code;
      }
    });
    for (let j = 0; j < 3 * rows; j += 3) {
      screen[j] = x + scale * (screen[j] + shift[0]);
      screen[j + 1] = y - scale * (screen[j + 1] + shift[1]);
      screen[j + 2] += shift[2];
    }
  }

  /** Colour numbers of the fluid rows, and the table that they stand for. */
  fluidColours(frame) {
    const group = this.groups.fluid, name = this.options.colour;
    const result = (this.colourNumbers ??= new Uint16Array(group.rows));
    if (!group.has(name)) return { result: result.fill(0), table: shaded(this.maps.categories) };
    const codes = group.codes[name], from = group.at(name, frame), channel = group.channels[name];
    const ends = this.range(name);
    if (!ends) {
      const last = this.maps.categories.length / 3 - 1;
      for (let i = 0; i < group.rows; i++) {
        result[i] = Math.min(last, Math.round(channel.low + channel.step * codes[from + i]));
      }
      return { result, table: shaded(this.maps.categories) };
    }
    const table = (this.mapTable ??= shaded(this.maps.continuous));
    const most = table.count - 1;
    const factor = (most * channel.step) / (ends[1] - ends[0]), offset = (most * (channel.low - ends[0])) / (ends[1] - ends[0]);
    for (let i = 0; i < group.rows; i++) {
      const share = offset + factor * codes[from + i];
      result[i] = share < 0 ? 0 : share > most ? most : share + 0.5;
    }
    return { result, table };
  }

  range(name) {
    return (this.ranges || this.known.ranges)[name];
  }

  /** Rows from the nearest to the farthest, roughly; in 2D as they are. */
  order(group) {
    const rows = group.rows, order = (group.order ??= Uint32Array.from({ length: rows }, (_, i) => i));
    if (this.dimension === 2) return order;
    const screen = group.screen, counts = new Uint32Array(BUCKETS + 1);
    let low = Infinity, high = -Infinity;
    for (let j = 2; j < 3 * rows; j += 3) {
      if (screen[j] < low) low = screen[j];
      if (screen[j] > high) high = screen[j];
    }
    const factor = (BUCKETS - 1) / Math.max(high - low, 1e-30);
    for (let j = 2; j < 3 * rows; j += 3) counts[1 + ((factor * (high - screen[j])) | 0)]++;
    for (let b = 0; b < BUCKETS; b++) counts[b + 1] += counts[b];
    for (let i = 0, j = 2; i < rows; i++, j += 3) order[counts[(factor * (high - screen[j])) | 0]++] = i;
    return order;
  }

  splat(group, stamp, colours, numbers, frame) {
    const { pixels, depth } = this, width = this.canvas.width, height = this.canvas.height;
    const screen = group.screen, { table, count } = colours, { reach, top, dx, dy, lift, shade, length } = stamp;
    const offset = new Int32Array(length), side = reach * width, balls = this.dimension === 3 && top > 0;
    for (let k = 0; k < length; k++) offset[k] = dy[k] * width + dx[k];
    const gaps = group.has("absent"), order = this.order(group);
    for (let n = 0; n < group.rows; n++) {
      const i = order[n], colour = numbers[i];
      if (colour === HIDDEN || (gaps && group.absent(frame, i))) continue;
      const px = Math.round(screen[3 * i]), py = Math.round(screen[3 * i + 1]), z = screen[3 * i + 2];
      if (px + reach < 0 || py + reach < 0 || px - reach >= width || py - reach >= height) continue;
      const base = py * width + px, whole = px >= reach && py >= reach && px + reach < width && py + reach < height;
      if (whole) {
        const nearest = z + top;
        // Most balls are inside the water, behind others that are drawn already.
        if (balls && depth[base] > nearest && depth[base - reach] > nearest && depth[base + reach] > nearest &&
            depth[base - side] > nearest && depth[base + side] > nearest) continue;
        for (let k = 0; k < length; k++) {
          const p = base + offset[k], d = z + lift[k];
          if (d > depth[p]) {
            depth[p] = d;
            pixels[p] = table[shade[k] * count + colour];
          }
        }
      } else {
        for (let k = 0; k < length; k++) {
          const x = px + dx[k], y = py + dy[k];
          if (x < 0 || y < 0 || x >= width || y >= height) continue;
          const p = base + offset[k], d = z + lift[k];
          if (d > depth[p]) {
            depth[p] = d;
            pixels[p] = table[shade[k] * count + colour];
          }
        }
      }
    }
  }

  stamp(group, camera, round) {
    const part = round ? (this.dimension === 3 ? 0.62 : 0.66) : this.dimension === 3 ? 0.85 : 0.62;
    const radius = part * group.distance * camera.scale;
    const key = `${radius.toFixed(2)}/${round}`;
    group.stamps ??= new Map();
    if (!group.stamps.has(key)) {
      if (group.stamps.size > 20) group.stamps.clear();
      group.stamps.set(key, new Stamp(Math.min(radius, 60), part * group.distance, round, this.dimension));
    }
    return group.stamps.get(key);
  }

  draw(frame = this.frame, share = 0) {
    this.frame = frame;
    if (!this.image) return;
    if (!this.ink) this.theme();
    const begin = performance.now();
    const camera = (this.lastCamera = this.camera());
    const { fluid } = this.groups;
    this.drawWalls(camera, frame, share);
    if (fluid) {
      this.project(fluid, camera, frame, share);
      const { result, table } = this.fluidColours(frame);
      this.splat(fluid, this.stamp(fluid, camera, true), table, result, frame);
    }
    this.context.putImageData(this.image, 0, 0);
    this.context.font = this.font;
    if (this.dimension === 2) this.drawAxes(camera);
    else this.drawTriad(camera);
    this.drawTime(frame, share);
    if (fluid) this.drawMarks(frame);
    this.drawn++;
    this.work += 0.2 * (performance.now() - begin - this.work);
  }

  /** Draw coarser, and coarser still where pictures come too slowly; not `moving`: fine again. */
  adapt(moving) {
    const now = performance.now(), before = this.most;
    if (!moving) {
      this.most = STILL;
      this.last = null;
    } else {
      if (this.last === null) {
        this.most = Math.min(MOVING, this.coarse || MOVING);
        this.span = 0;
      } else this.span += 0.2 * (Math.min(now - this.last, 200) - this.span);
      this.last = now;
      if (this.span > SLOW && this.work > WORK && this.most > FEWEST) {
        this.most = Math.max(FEWEST, 0.7 * Math.min(this.most, this.canvas.width * this.canvas.height));
        this.coarse = this.most; // remembered for the next time
        this.span = 0;
      }
    }
    if (this.most !== before && this.resize()) this.theme(); // asking for sizes makes the browser lay out the page
  }

  /** Background and walls, which are kept while neither they nor the eye move. */
  drawWalls(camera, frame, share) {
    const { wall } = this.groups, shown = wall && this.options.walls;
    const moving = shown && Object.values(wall.channels).some((channel) => channel.frames > 1);
    const key = [this.azimuth, this.height, this.zoom, ...this.middle, this.canvas.width, this.canvas.height, this.background,
      shown, moving ? frame + share : 0].join();
    if (this.kept?.key === key) {
      this.pixels.set(this.kept.pixels);
      this.depth.set(this.kept.depth);
      return;
    }
    this.pixels.fill(this.background);
    this.depth.fill(-Infinity);
    if (shown) {
      this.project(wall, camera, frame, share);
      if (this.dimension === 2) for (let j = 2; j < wall.screen.length; j += 3) wall.screen[j] = -1e9;
      const light = this.wallLight(wall, camera, frame);
      this.splat(wall, this.stamp(wall, camera, false), this.wallColours, light, frame);
    }
    if (!moving) this.kept = { key, pixels: this.pixels.slice(), depth: this.depth.slice() };
  }

  /** How light each wall row is; in 3D HIDDEN where it looks away: the floor and the far sides of a tank are seen. */
  wallLight(wall, camera, frame) {
    const light = (wall.light ??= new Uint16Array(wall.rows));
    if (this.dimension === 2 || !wall.has("normal_x")) return light.fill(GREYS - 1);
    const eye = camera.axes[2], from = ["normal_x", "normal_y", "normal_z"].map((name) => wall.at(name, frame));
    const [x, y, z] = ["normal_x", "normal_y", "normal_z"].map((name) => wall.channels[name]);
    for (let i = 0; i < wall.rows; i++) {
      const a = x.low + x.step * wall.codes.normal_x[from[0] + i], b = y.low + y.step * wall.codes.normal_y[from[1] + i];
      const c = z.low + z.step * wall.codes.normal_z[from[2] + i];
      if (eye[0] * a + eye[1] * b + eye[2] * c < 0.03) light[i] = HIDDEN;
      else light[i] = Math.max(0, Math.min(GREYS - 1, Math.round((GREYS - 1) * (0.55 + 0.45 * c - 0.35 * Math.abs(a)))));
    }
    return light;
  }

  drawAxes(camera) {
    const c = this.context, unit = this.ratio;
    const [left, right, top, bottom] = this.margins();
    const w = this.canvas.width, h = this.canvas.height;
    c.fillStyle = this.paper;
    c.fillRect(0, h - bottom, w, bottom);
    c.fillRect(0, 0, left, h);
    c.fillRect(0, 0, w, top);
    c.fillRect(w - right, 0, right, h);
    c.strokeStyle = this.faint;
    c.lineWidth = unit;
    c.strokeRect(left, top, w - left - right, h - top - bottom);
    c.fillStyle = this.ink;
    const value = [(p) => camera.centre[0] + (p - camera.x) / camera.scale, (p) => camera.centre[1] - (p - camera.y) / camera.scale];
    c.textAlign = "center";
    c.textBaseline = "top";
    this.ticks(value[0](left), value[0](w - right), (w - left - right) / (80 * unit), (t, text) => {
      const p = camera.x + (t - camera.centre[0]) * camera.scale;
      c.fillRect(p, h - bottom, unit, 4 * unit);
      c.fillText(text, p, h - bottom + 6 * unit);
    });
    c.fillText("x [m]", (left + w - right) / 2, h - 15 * unit);
    c.textAlign = "right";
    c.textBaseline = "middle";
    this.ticks(value[1](h - bottom), value[1](top), (h - top - bottom) / (45 * unit), (t, text) => {
      const p = camera.y - (t - camera.centre[1]) * camera.scale;
      c.fillRect(left - 4 * unit, p, 4 * unit, unit);
      c.fillText(text, left - 6 * unit, p);
    });
    c.save();
    c.translate(10 * unit, (top + h - bottom) / 2);
    c.rotate(-Math.PI / 2);
    c.textAlign = "center";
    c.fillText("y [m]", 0, 0);
    c.restore();
  }

  ticks(low, high, wanted, place) {
    const step = niceStep(high - low, wanted);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-12) + 1e-12; k++) place(k * step, (k * step).toFixed(digits));
  }

  drawTime(frame, share) {
    const times = this.times, next = times[Math.min(frame + 1, times.length - 1)];
    const [left, , top] = this.margins();
    this.context.textAlign = "left";
    this.context.textBaseline = "top";
    this.context.fillStyle = this.ink;
    this.context.fillText(`t = ${(times[frame] + share * (next - times[frame])).toFixed(3)} s`, left, top - 16 * this.ratio);
  }

  /** Directions of the axes and a length to compare with. */
  drawTriad(camera) {
    const c = this.context, unit = this.ratio;
    const x0 = 46 * unit, y0 = this.canvas.height - 46 * unit, long = 30 * unit;
    c.strokeStyle = c.fillStyle = this.ink;
    c.lineWidth = 1.5 * unit;
    c.textAlign = "center";
    c.textBaseline = "middle";
    ["x", "y", "z"].forEach((name, k) => {
      const dx = camera.axes[0][k], dy = -camera.axes[1][k];
      c.beginPath();
      c.moveTo(x0, y0);
      c.lineTo(x0 + long * dx, y0 + long * dy);
      c.stroke();
      if (Math.hypot(dx, dy) > 0.15) c.fillText(name, x0 + (long + 9 * unit) * dx, y0 + (long + 9 * unit) * dy);
    });
    const length = niceStep((0.12 * this.canvas.width) / camera.scale, 1);
    const right = this.canvas.width - 20 * unit, left = right - length * camera.scale, y = this.canvas.height - 18 * unit;
    c.beginPath();
    c.moveTo(left, y - 4 * unit);
    c.lineTo(left, y);
    c.lineTo(right, y);
    c.lineTo(right, y - 4 * unit);
    c.stroke();
    c.textBaseline = "bottom";
    c.fillText(`${Number(length.toPrecision(3))} m`, (left + right) / 2, y - 6 * unit);
  }

  ring(row, colour, wide) {
    const c = this.context, s = this.groups.fluid.screen, radius = Math.max(7 * this.ratio, 0);
    c.beginPath();
    c.arc(s[3 * row], s[3 * row + 1], radius, 0, TAU);
    c.lineWidth = (wide + 2) * this.ratio;
    c.strokeStyle = this.paper;
    c.stroke();
    c.lineWidth = wide * this.ratio;
    c.strokeStyle = colour;
    c.stroke();
  }

  drawMarks(frame) {
    this.largest = this.extreme(frame);
    if (this.options.extreme && this.largest >= 0) this.ring(this.largest, this.mark, 1.5);
    if (this.selected >= 0) this.ring(this.selected, this.ink, 2.5);
  }

  /** Row with the largest value of what colours, in this frame; -1 where nothing continuous does. */
  extreme(frame) {
    const group = this.groups.fluid, name = this.options.colour;
    if (!group.has(name) || !this.range(name)) return -1;
    const codes = group.codes[name], from = group.at(name, frame), gaps = group.has("absent");
    let best = -1, row = -1;
    for (let i = 0; i < group.rows; i++) {
      if (codes[from + i] > best && !(gaps && group.absent(frame, i))) {
        best = codes[from + i];
        row = i;
      }
    }
    return row;
  }

  /** Fluid row at a place of the page; the one nearest to the eye. */
  pick(x, y) {
    const group = this.groups.fluid;
    if (!group) return -1;
    const box = this.canvas.getBoundingClientRect();
    const px = (x - box.left) * this.ratio, py = (y - box.top) * this.ratio;
    const reach = Math.max(8 * this.ratio, 0.6 * group.distance * this.lastCamera.scale);
    let found = -1, best = -Infinity;
    for (let i = 0; i < group.rows; i++) {
      const far = Math.hypot(group.screen[3 * i] - px, group.screen[3 * i + 1] - py);
      if (far > reach || group.absent(this.frame, i)) continue;
      const rank = this.dimension === 2 ? -far : group.screen[3 * i + 2] - 0.01 * (far / this.lastCamera.scale);
      if (rank > best) {
        best = rank;
        found = i;
      }
    }
    return found;
  }

  /** What is known of a row in the present frame, as text. */
  described(row) {
    const group = this.groups.fluid;
    const id = group.id(row);
    const place = ["x", "y", "z"].slice(0, this.dimension).map((a) => shortNumber(group.value(a, this.frame, row)));
    const parts = [`${id === null ? "particle" : `particle ${id}`} at (${place.join(", ")}) m`];
    if (group.absent(this.frame, row)) return `${parts[0]}: not in this frame`;
    if (group.has("pressure")) parts.push(`pressure ${shortNumber(group.value("pressure", this.frame, row), 3)} Pa`);
    if (group.has("speed")) parts.push(`speed ${shortNumber(group.value("speed", this.frame, row), 3)} m/s`);
    return parts.join(", ");
  }

  pan(dx, dy) {
    const { axes, scale } = this.lastCamera;
    for (let c = 0; c < this.dimension; c++) {
      this.middle[c] -= ((axes[0][c] * dx - axes[1][c] * dy) * this.ratio) / scale;
    }
  }
  orbit(dx, dy) {
    this.azimuth -= 0.4 * dx;
    this.height = Math.max(-89, Math.min(89, this.height + 0.4 * dy));
  }
  /** Zoom in or out; the place under (x, y) of the page stays where it is. */
  magnify(factor, x, y) {
    const before = this.zoom;
    this.zoom = Math.max(0.2, Math.min(60, this.zoom * factor));
    if (x === undefined || !this.lastCamera) return;
    const box = this.canvas.getBoundingClientRect();
    const dx = x - box.left - this.lastCamera.x / this.ratio, dy = y - box.top - this.lastCamera.y / this.ratio;
    const gain = this.zoom / before;
    this.pan(-dx * (1 - 1 / gain), -dy * (1 - 1 / gain));
  }
}
