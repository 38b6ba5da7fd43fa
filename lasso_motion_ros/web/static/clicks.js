// The clicks of both planes, with undo; and the smooth curve through them.

const LONGEST_HISTORY = 200;

export class Clicks {
  constructor() {
    this.reset();
  }

  reset(points = { a: [], b: [] }) {
    this.points = { a: points.a.slice(), b: points.b.slice() };
    this.history = [];
  }

  /** Remember the state before a change, so that it can be undone. */
  remember() {
    this.history.push(JSON.stringify(this.points));
    if (this.history.length > LONGEST_HISTORY) this.history.shift();
  }

  add(plane, point) {
    this.remember();
    this.points[plane].push(point);
  }

  move(plane, index, point) {
    this.points[plane][index] = point;
  }

  clear(plane) {
    if (!this.points[plane].length) return;
    this.remember();
    this.points[plane] = [];
  }

  removeLast(plane) {
    if (!this.points[plane].length) return;
    this.remember();
    this.points[plane].pop();
  }

  undo() {
    const before = this.history.pop();
    if (before) this.points = JSON.parse(before);
    return Boolean(before);
  }
}

/**
 * Centripetal Catmull-Rom curve through points, about one point a pixel (Yuksel, Schaefer, Keyser 2011): it passes
 * through every click and makes no loops of its own between two.
 */
export function smooth(points, closed) {
  const distinct = points.filter((p, i) => i === 0 || Math.hypot(p[0] - points[i - 1][0], p[1] - points[i - 1][1]) > 1e-6);
  const n = distinct.length;
  if (n < 3) return distinct.slice();
  const at = (i) => {
    if (closed) return distinct[((i % n) + n) % n];
    if (i < 0) return mirror(distinct[0], distinct[1]);
    if (i >= n) return mirror(distinct[n - 1], distinct[n - 2]);
    return distinct[i];
  };
  const curve = [];
  for (let i = 0; i < (closed ? n : n - 1); i++) {
    const [p0, p1, p2, p3] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
    const [d1, d2, d3] = [knot(p0, p1), knot(p1, p2), knot(p2, p3)];
    const steps = Math.min(60, Math.max(1, Math.round(Math.hypot(p2[0] - p1[0], p2[1] - p1[1]))));
    for (let s = 0; s < steps; s++) {
      const t = d1 + (d2 * s) / steps;
      const a1 = mix(p0, p1, t / d1), a2 = mix(p1, p2, (t - d1) / d2), a3 = mix(p2, p3, (t - d1 - d2) / d3);
      const b1 = mix(a1, a2, t / (d1 + d2)), b2 = mix(a2, a3, (t - d1) / (d2 + d3));
      curve.push(mix(b1, b2, (t - d1) / d2));
    }
  }
  curve.push(closed ? distinct[0] : distinct[n - 1]);
  return curve;
}

const mirror = (end, inner) => [2 * end[0] - inner[0], 2 * end[1] - inner[1]];
const knot = (p, q) => Math.max(1e-6, Math.sqrt(Math.hypot(p[0] - q[0], p[1] - q[1])));
const mix = (p, q, t) => [p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t];
