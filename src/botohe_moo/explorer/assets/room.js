// What stands where on a map, as costs of its cells: names look for places that cost little.

const CELL = 4; // pixels
const BESIDE = 1, CROSSED = 20, TAKEN = 10_000; // what a cell costs with an arc, a trail, a node or a name in it

class Room {
  constructor(columns, cells) {
    Object.assign(this, { columns, cells });
  }

  /** Let a line cost something, where nothing costs more. */
  trace(from, to, cost) {
    const n = Math.ceil(apart(from, to) / CELL) || 1;
    for (let i = 0; i <= n; i += 1) {
      const [x, y] = [0, 1].map((axis) => from[axis] + (i / n) * (to[axis] - from[axis]));
      const cell = Math.floor(y / CELL) * this.columns + Math.floor(x / CELL);
      if (this.cells[cell] < cost) this.cells[cell] = cost;
    }
  }

  /** The rows of the cells of a box: where they begin and end. */
  rows(part) {
    const [left, top, right, bottom] = part.map((pixels) => Math.max(Math.round(pixels / CELL), 0));
    return d3.range(top, bottom).map((row) =>
      [row * this.columns + left, row * this.columns + Math.min(right, this.columns)]);
  }

  take(part) {
    for (const [from, to] of this.rows(part)) this.cells.fill(TAKEN, from, to);
  }

  /** What a box costs, or more than the limit. */
  cost(part, limit) {
    let sum = 0;
    for (const [from, to] of this.rows(part)) {
      for (let cell = from; cell < to; cell += 1) sum += this.cells[cell];
      if (sum > limit) break;
    }
    return sum;
  }
}
