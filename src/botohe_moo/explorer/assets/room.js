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

  take([left, top, right, bottom]) {
    for (let row = top; row < bottom; row += 1) {
      this.cells.fill(TAKEN, row * this.columns + left, row * this.columns + right);
    }
  }

  /** What a part costs, or more than the limit. */
  cost([left, top, right, bottom], limit) {
    let sum = 0;
    for (let row = top; row < bottom && sum <= limit; row += 1) {
      for (let cell = row * this.columns + left; cell < row * this.columns + right; cell += 1) sum += this.cells[cell];
    }
    return sum;
  }
}

/** The part of the room that a box takes. */
const inCells = (pixels) => pixels.map((one) => Math.round(one / CELL));
