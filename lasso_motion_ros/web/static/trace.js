// The motion of the last 30 s along three axes. Gaps are times without a pose.

const SPAN_S = 30;
const HEIGHT_PX = 96;
const GAP_S = 2.5; // longer without a pose is no line
const COLOURS = ["#ff7b72", "#7ee787", "#79c0ff"];

export class Trace {
  constructor(root) {
    this.rows = [];
    this.offset = null; // this page's clock (s) less the server's
    this.plot = new uPlot(
      {
        width: Math.max(200, root.clientWidth),
        height: HEIGHT_PX,
        legend: { show: false },
        cursor: { show: false },
        padding: [8, 16, 0, 0],
        scales: {
          x: { time: false, range: () => [-SPAN_S, 0] },
          // At least ±5 mm, so that noise does not look like breathing.
          y: { range: (_, low, high) => [Math.min(-5, Math.floor((low ?? 0) - 1)), Math.max(5, Math.ceil((high ?? 0) + 1))] },
        },
        axes: [
          axis({ values: (_, ticks) => ticks.map((t) => (t === 0 ? "now" : `${t} s`)), size: 26 }),
          axis({ size: 34, space: 16 }),
        ],
        series: [{}, ...COLOURS.map((stroke) => ({ stroke, width: 2, points: { show: false }, spanGaps: false }))],
      },
      [[], [], [], []],
      root,
    );
    new ResizeObserver(() => this.plot.setSize({ width: Math.max(200, root.clientWidth), height: HEIGHT_PX })).observe(root);
  }

  /** rows: [time (server's clock, s), x, y, z (mm, or null)]. */
  add(rows) {
    const newest = rows[rows.length - 1][0];
    const lag = performance.now() / 1000 - newest;
    // The smallest lag is that of the message that waited least; another server has another clock.
    if (this.offset === null || lag < this.offset || Math.abs(lag - this.offset) > SPAN_S) this.offset = lag;
    for (const row of rows) {
      // A new answer to an old pair replaces the former one and all that followed it.
      while (this.rows.length && this.rows[this.rows.length - 1][0] >= row[0]) this.rows.pop();
      const last = this.rows[this.rows.length - 1];
      if (last && row[0] - last[0] > GAP_S) this.rows.push([row[0] - 1e-3, null, null, null]);
      this.rows.push(row);
    }
  }

  draw() {
    const now = performance.now() / 1000 - (this.offset ?? 0);
    const first = this.rows.findIndex((row) => row[0] >= now - SPAN_S - 5);
    this.rows = first < 0 ? [] : this.rows.slice(first);
    this.plot.setData([this.rows.map((row) => row[0] - now), ...[1, 2, 3].map((i) => this.rows.map((row) => row[i]))]);
  }

  clear() {
    this.rows = [];
    this.offset = null;
  }
}

function axis(more) {
  return {
    stroke: "#9fb0c0",
    font: "11px system-ui, sans-serif",
    grid: { stroke: "#ffffff18", width: 1 },
    ticks: { show: false },
    ...more,
  };
}
