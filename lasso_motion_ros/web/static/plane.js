// One plane's picture: zoom, pan, clicking, and what is drawn over it. Pixel (x, y) has its centre at (x, y).

const CLICK_PX = 4;
const GRAB_PX = 9;
const LARGEST_ZOOM = 24;
const BUTTON_ZOOM = 1.5;
const CLICK_COLOUR = "#78beff";
const ELLIPSE_COLOUR = "#ff9df5"; // like nothing else on the page
const LOOP_COLOUR = "#ffe240"; // as in the overlay node's pictures
const PROPOSAL_COLOUR = "#33e6ff"; // as in plane_x/tracking

export class Plane {
  /** act: {add, remove, grab, move, choose, window, refuse}: what to do when the user clicks, right-clicks, drags a point,
   * comes here, drags with the right button (or Shift) for brightness and contrast, clicks where it does nothing. */
  constructor(root, name, act) {
    this.root = root;
    this.name = name;
    this.act = act;
    this.film = canvas("film");
    this.marks = canvas("marks");
    this.marks.tabIndex = 0;
    this.marks.setAttribute("aria-label", `Plane ${name.toUpperCase()}: arrows move, Space sets a point`);
    this.label = div("name", `Plane ${name.toUpperCase()}`);
    this.angle = div("angle"); // where the detector stands
    this.count = div("count");
    this.note = div("note", "no picture yet");
    this.scale = button("1.0×", `Show plane ${name.toUpperCase()} whole`, () => this.whole());
    this.scale.className = "scale";
    this.out = button("−", `Zoom plane ${name.toUpperCase()} out`, () => this.zoomBy(1 / BUTTON_ZOOM));
    this.in = button("+", `Zoom plane ${name.toUpperCase()} in`, () => this.zoomBy(BUTTON_ZOOM));
    const caption = div("caption");
    caption.append(this.label, this.angle, this.count);
    const zoom = div("zoom");
    zoom.append(this.out, this.scale, this.in);
    this.stage = div("stage");
    this.stage.append(this.film, this.marks, this.note, zoom);
    root.append(caption, this.stage);
    this.bitmap = null;
    this.loop = null;
    this.doubtful = false;
    this.points = [];
    this.curve = null;
    this.ellipse = null;
    this.clicking = false;
    this.cross = null;
    this.zoom = 1;
    this.centre = null;
    this.listen();
    new ResizeObserver(() => this.resize()).observe(this.stage);
  }

  // What is shown.

  show(bitmap, loop) {
    const other = !this.bitmap || bitmap.width !== this.bitmap.width || bitmap.height !== this.bitmap.height;
    this.bitmap?.close();
    this.bitmap = bitmap;
    this.loop = loop;
    if (other) this.whole();
    else this.draw();
  }

  whole() {
    this.zoom = 1;
    this.centre = this.bitmap ? [(this.bitmap.width - 1) / 2, (this.bitmap.height - 1) / 2] : null;
    this.draw();
  }

  say(text) {
    this.note.textContent = text;
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    for (const one of [this.film, this.marks]) {
      one.width = Math.max(1, Math.round(this.stage.clientWidth * ratio));
      one.height = Math.max(1, Math.round(this.stage.clientHeight * ratio));
    }
    this.draw();
  }

  /** Canvas pixels per image pixel. */
  get factor() {
    return this.zoom * Math.min(this.film.width / this.bitmap.width, this.film.height / this.bitmap.height);
  }

  toCanvas([x, y]) {
    const s = this.factor;
    return [(x - this.centre[0]) * s + this.film.width / 2, (y - this.centre[1]) * s + this.film.height / 2];
  }

  toImage([x, y]) {
    const s = this.factor;
    return [(x - this.film.width / 2) / s + this.centre[0], (y - this.film.height / 2) / s + this.centre[1]];
  }

  draw() {
    if (!this.bitmap) return;
    this.centre ??= [(this.bitmap.width - 1) / 2, (this.bitmap.height - 1) / 2];
    const film = this.film.getContext("2d");
    const s = this.factor;
    film.imageSmoothingEnabled = s < 4;
    film.clearRect(0, 0, this.film.width, this.film.height);
    film.drawImage(this.bitmap, ...this.toCanvas([-0.5, -0.5]), this.bitmap.width * s, this.bitmap.height * s);
    this.drawMarks();
    this.scale.textContent = `${this.zoom.toFixed(1)}×`;
    this.out.disabled = this.scale.disabled = this.zoom <= 1;
    this.in.disabled = this.zoom >= LARGEST_ZOOM;
    // A finger scrolls the page where there is nothing to move in the picture.
    this.marks.style.touchAction = this.zoom > 1 || this.clicking ? "none" : "pan-y";
  }

  drawMarks() {
    const marks = this.marks.getContext("2d");
    const ratio = window.devicePixelRatio || 1;
    marks.clearRect(0, 0, this.marks.width, this.marks.height);
    if (!this.bitmap) return;
    marks.lineJoin = marks.lineCap = "round";
    if (this.loop) {
      this.line(marks, this.loop, "#000000", 3.2 * ratio, 0.45);
      marks.setLineDash(this.doubtful ? [7 * ratio, 5 * ratio] : []);
      this.line(marks, this.loop, this.proposed ? PROPOSAL_COLOUR : LOOP_COLOUR, 1.8 * ratio, 1);
      marks.setLineDash([]);
    }
    if (this.ellipse) {
      marks.setLineDash([6 * ratio, 4 * ratio]);
      this.line(marks, this.ellipse, ELLIPSE_COLOUR, 1.6 * ratio, 1);
      marks.setLineDash([]);
    }
    if (this.curve) this.line(marks, this.curve, CLICK_COLOUR, 1.3 * ratio, 0.9);
    this.points.forEach((point, index) => this.drawPoint(marks, point, index, ratio));
    if (this.cross && this.clicking) this.drawCross(marks, this.cross, ratio);
  }

  line(marks, points, colour, width, opacity) {
    marks.strokeStyle = colour;
    marks.lineWidth = width;
    marks.globalAlpha = opacity;
    marks.beginPath();
    points.forEach((point, index) => marks[index ? "lineTo" : "moveTo"](...this.toCanvas(point)));
    marks.stroke();
    marks.globalAlpha = 1;
  }

  drawPoint(marks, point, index, ratio) {
    const [x, y] = this.toCanvas(point);
    for (const [colour, width] of [["#000000", 3], [CLICK_COLOUR, 1.5]]) {
      marks.strokeStyle = colour;
      marks.lineWidth = width * ratio;
      marks.beginPath();
      marks.arc(x, y, 4.5 * ratio, 0, 2 * Math.PI);
      marks.stroke();
    }
    marks.font = `${12 * ratio}px system-ui, sans-serif`;
    marks.lineWidth = 3 * ratio;
    marks.strokeStyle = "#000000";
    marks.fillStyle = CLICK_COLOUR;
    marks.strokeText(index + 1, x + 7 * ratio, y - 5 * ratio);
    marks.fillText(index + 1, x + 7 * ratio, y - 5 * ratio);
  }

  drawCross(marks, point, ratio) {
    const [x, y] = this.toCanvas(point);
    marks.strokeStyle = "#ffffff";
    marks.lineWidth = ratio;
    marks.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      marks.moveTo(x + 4 * dx * ratio, y + 4 * dy * ratio);
      marks.lineTo(x + 16 * dx * ratio, y + 16 * dy * ratio);
    }
    marks.stroke();
  }

  // What the user does.

  listen() {
    let press = null;
    let pinch = null; // two fingers: their distance and middle
    const fingers = new Map();
    const where = (event) => {
      const box = this.marks.getBoundingClientRect();
      return [
        ((event.clientX - box.left) * this.marks.width) / box.width,
        ((event.clientY - box.top) * this.marks.height) / box.height,
      ];
    };
    const spread = () => {
      const [p, q] = [...fingers.values()];
      return { apart: Math.max(1, Math.hypot(p[0] - q[0], p[1] - q[1])), middle: [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2] };
    };
    this.marks.addEventListener("pointerdown", (event) => {
      if (!this.bitmap) return;
      this.marks.setPointerCapture(event.pointerId);
      const at = where(event);
      fingers.set(event.pointerId, at);
      if (fingers.size === 2) {
        press = null; // two fingers set no point
        pinch = spread();
        return;
      }
      if (fingers.size > 2) return;
      const windows = event.button === 2 || event.shiftKey;
      const grabs = this.clicking && !windows && event.button === 0;
      press = { at, last: at, moved: false, windows, button: event.button, point: grabs ? this.pointAt(at) : null };
    });
    this.marks.addEventListener("pointermove", (event) => {
      const at = where(event);
      if (fingers.has(event.pointerId)) fingers.set(event.pointerId, at);
      if (pinch && fingers.size === 2) {
        const now = spread();
        this.zoomBy(now.apart / pinch.apart, now.middle);
        const s = this.factor;
        if (this.zoom > 1) this.pan((pinch.middle[0] - now.middle[0]) / s, (pinch.middle[1] - now.middle[1]) / s);
        pinch = now;
        return;
      }
      if (!press) return;
      const ratio = window.devicePixelRatio || 1;
      if (!press.moved && Math.hypot(at[0] - press.at[0], at[1] - press.at[1]) < CLICK_PX * ratio) return;
      if (!press.moved && press.point !== null) this.act.grab(this.name);
      press.moved = true;
      if (press.windows) {
        const width = this.stage.clientWidth * ratio;
        this.act.window(this.name, (at[0] - press.last[0]) / width, (press.last[1] - at[1]) / width);
      } else if (press.point !== null) this.act.move(this.name, press.point, this.inside(this.toImage(at)));
      else {
        const s = this.factor;
        this.pan((press.last[0] - at[0]) / s, (press.last[1] - at[1]) / s);
      }
      press.last = at;
    });
    this.marks.addEventListener("pointerup", (event) => {
      fingers.delete(event.pointerId);
      if (pinch) {
        if (!fingers.size) pinch = null;
        return;
      }
      if (!press) return;
      const { moved, at, point, button } = press;
      press = null;
      if (moved) return;
      if (button === 2 && this.clicking) this.act.remove(this.name);
      if (button !== 0) return;
      if (!this.clicking) {
        this.act.refuse(this.name, "live");
        return;
      }
      // Points may lie close together, as on a loop seen edge-on, but not on top of each other.
      if (point !== null && this.pointAt(at, CLICK_PX) !== null) {
        this.act.refuse(this.name, "taken");
        return;
      }
      const [x, y] = this.toImage(at);
      if (x < -0.5 || y < -0.5 || x > this.bitmap.width - 0.5 || y > this.bitmap.height - 0.5) {
        this.act.refuse(this.name, "outside");
        return;
      }
      this.act.add(this.name, [x, y]);
    });
    this.marks.addEventListener("pointercancel", (event) => {
      fingers.delete(event.pointerId);
      press = pinch = null;
    });
    this.marks.addEventListener("contextmenu", (event) => event.preventDefault());
    this.marks.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.bitmap) this.zoomBy(Math.exp(-event.deltaY / (event.deltaMode === 1 ? 12 : 400)), where(event));
    }, { passive: false });
    this.marks.addEventListener("focus", () => this.act.choose(this.name));
    this.marks.addEventListener("pointerenter", () => this.act.choose(this.name));
  }

  pointAt(at, within = GRAB_PX) {
    const ratio = window.devicePixelRatio || 1;
    let nearest = null, closest = within * ratio;
    this.points.forEach((point, index) => {
      const [x, y] = this.toCanvas(point);
      const distance = Math.hypot(x - at[0], y - at[1]);
      if (distance < closest) [nearest, closest] = [index, distance];
    });
    return nearest;
  }

  zoomBy(times, at = [this.film.width / 2, this.film.height / 2]) {
    if (!this.bitmap) return;
    const fixed = this.toImage(at);
    this.zoom = Math.min(LARGEST_ZOOM, Math.max(1, this.zoom * times));
    const moved = this.toImage(at);
    if (this.zoom === 1) this.whole();
    else this.pan(fixed[0] - moved[0], fixed[1] - moved[1]);
  }

  pan(dx, dy) {
    if (!this.bitmap) return;
    this.centre = this.inside([this.centre[0] + dx, this.centre[1] + dy]);
    this.draw();
  }

  inside([x, y]) {
    return [Math.min(Math.max(x, -0.5), this.bitmap.width - 0.5), Math.min(Math.max(y, -0.5), this.bitmap.height - 0.5)];
  }

  /** Arrow keys: move the cross while clicking, else the picture. */
  step(dx, dy) {
    if (!this.bitmap) return;
    if (!this.clicking) {
      this.pan((16 * dx) / this.zoom, (16 * dy) / this.zoom);
      return;
    }
    const from = this.cross ?? this.centre.map(Math.round);
    this.cross = this.inside([from[0] + dx, from[1] + dy]);
    const [x, y] = this.toCanvas(this.cross);
    if (x < 0 || y < 0 || x > this.film.width || y > this.film.height) this.pan(dx, dy);
    this.drawMarks();
  }
}

function canvas(kind) {
  const made = document.createElement("canvas");
  made.className = kind;
  return made;
}

function button(sign, words, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = sign;
  made.setAttribute("aria-label", words);
  made.title = words;
  made.addEventListener("click", act);
  return made;
}

function div(kind, text = "") {
  const made = document.createElement("div");
  made.className = kind;
  made.textContent = text;
  return made;
}
